"""The formats by name, and exporting and importing by them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import write_atomic
from cadpose.annotations.formats.bop import BOP
from cadpose.annotations.formats.coco import COCO
from cadpose.annotations.formats.csv_file import CSV
from cadpose.annotations.formats.fiftyone import FIFTYONE
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.label_studio import LABEL_STUDIO
from cadpose.annotations.formats.parquet import PARQUET
from cadpose.annotations.formats.pascal3d import PASCAL3D
from cadpose.annotations.formats.pix3d import PIX3D
from cadpose.annotations.formats.scenes import GLTF, USD
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import file_stem, new_file, new_folder
from cadpose.errors import InputError

#: Every format by its name.
FORMATS: dict[str, Format] = {
    kind.name: kind for kind in (COCO, BOP, PIX3D, PASCAL3D, LABEL_STUDIO, FIFTYONE, GLTF, USD, PARQUET, CSV)
}


def export(
    name: str,
    documents: Iterable[AnnotationDocument],
    out: Path,
    sources: Sources,
    *,
    force: bool = False,
    inputs: Iterable[Path] = (),
) -> int:
    """Write documents in a format; ``out`` is whole or as it was.

    Args:
        name: One of ``FORMATS``.
        documents: One in memory at a time.
        out: The file or folder.
        sources: Photos and library.
        force: Whether what ``out`` holds may be replaced.
        inputs: What is read, and so must not be replaced.

    Returns:
        How many annotations were written.

    Raises:
        InputError: there is no such format, nothing to write, or ``out`` is taken.
        CadposeError: what the writer raises.
    """
    kind = format_of(name)
    written = 0

    def counted() -> Iterator[AnnotationDocument]:
        nonlocal written
        for document in documents:
            written += len(document.annotations)
            yield document

    target = new_folder if kind.folder else new_file
    with target(out, force, list(inputs)) as place:
        kind.write(counted(), place, sources)
        if not written:
            raise InputError(f"there is no annotation to export, so {out} was not written: choose others")
    return written


def documents_from(name: str, path: Path) -> Iterator[AnnotationDocument]:
    """The documents that an export holds, one at a time.

    Raises:
        InputError: there is no such format, it cannot be read back, or ``path`` holds none.
    """
    kind = format_of(name)
    if kind.read is None:
        raise InputError(f"{name} cannot be read back: it does not hold the annotations")
    yield from kind.read(path)


def write_documents(
    documents: Iterable[AnnotationDocument], out: Path, *, force: bool = False, inputs: Iterable[Path] = ()
) -> int:
    """Write JSON documents into a folder, which is whole or as it was; returns how many.

    Args:
        documents: One in memory at a time.
        out: The folder.
        force: Whether what ``out`` holds may be replaced.
        inputs: What is read, and so must not be replaced.

    Raises:
        InputError: there is none, or ``out`` is taken or holds an input.
    """
    count = 0
    with new_folder(out, force, list(inputs)) as folder:
        for document in documents:
            write_atomic(folder / f"{file_stem(document)}.json", document.to_json().encode())
            count += 1
        if not count:
            raise InputError(f"there is no annotation to import, so {out} was not written")
    return count


def format_of(name: str) -> Format:
    """The format of that name.

    Raises:
        InputError: there is none.
    """
    if name not in FORMATS:
        raise InputError(f"there is no format {name!r}: choose {', '.join(FORMATS)}")
    return FORMATS[name]
