"""``cadpose export``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

import typer

from cadpose.cli.options import Categories, Json, LibraryFolder
from cadpose.cli.output import print_json

if TYPE_CHECKING:
    from collections.abc import Iterator

    from cadpose.annotations.document import AnnotationDocument


def _known_format(name: str) -> str:
    from cadpose.annotations.formats.registry import FORMATS

    if name not in FORMATS:
        raise typer.BadParameter(f"{name!r} is none of {', '.join(FORMATS)}")
    return name


def _known_verdicts(names: list[str] | None) -> list[str] | None:
    from cadpose.records import Verdict

    for name in names or ():
        if name not in get_args(Verdict):
            raise typer.BadParameter(f"{name!r} is none of {', '.join(get_args(Verdict))}")
    return names


FormatName = Annotated[
    str,
    typer.Argument(
        metavar="FORMAT",
        callback=_known_format,
        help="coco, bop, pix3d, pascal3d, label-studio, fiftyone, gltf, usd, parquet, csv.",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace what is at --out.")]


def export(
    name: FormatName,
    out: Annotated[Path, typer.Option("--out", "-o", help="File or folder to write, as the format is.")],
    store: Annotated[str | None, typer.Option("--store", help="Take the annotations of this store.")] = None,
    documents: Annotated[
        list[Path] | None,
        typer.Option("--from", help="Take documents of `cadpose annotate`, files or folders; repeatable."),
    ] = None,
    photos: Annotated[
        Path | None, typer.Option("--photos", help="Folder of the photos, for formats that hold them.")
    ] = None,
    library: LibraryFolder = None,
    category: Categories = None,
    verdict: Annotated[
        list[str] | None,
        typer.Option(
            "--verdict",
            callback=_known_verdicts,
            help="Only annotations of this verdict: auto_accept, review or reject; repeatable.",
        ),
    ] = None,
    camera: Annotated[
        Literal["object", "photo"],
        typer.Option(
            "--camera", help="bop, pix3d, gltf, usd: poses in each object's own camera, or in the photo's."
        ),
    ] = "object",
    force: Force = False,
    json: Json = False,
) -> None:
    """Write annotations in the format of another tool."""
    from cadpose.annotations.formats.registry import export as write
    from cadpose.annotations.formats.sources import Sources, chosen
    from cadpose.library.catalogue import default_path

    if (store is None) == (not documents):
        raise typer.BadParameter("name where the annotations are, either with --store or with --from")
    # Replacing the library that is taken unless told would lose it as well.
    held = [path for path in (photos, library or default_path()) if path is not None]
    inputs = [*(documents or ()), *_places(store), *held]
    sources = Sources(library, photos, camera == "photo")
    told = chosen(_documents(store, documents), category or (), verdict or ())
    count = write(name, told, out, sources, force=force, inputs=inputs)
    if json:
        print_json({"format": name, "annotations": count, "out": str(out)})
    else:
        typer.echo(f"{count} annotations: {out}")


def _documents(store: str | None, documents: list[Path] | None) -> Iterator[AnnotationDocument]:
    from cadpose.annotations.formats.sources import documents_in, documents_of_store

    return documents_in(documents or ()) if store is None else documents_of_store(store)


def _places(store: str | None) -> list[Path]:
    """The store's file, where it is one."""
    from cadpose.annotations.formats.sources import store_file

    path = None if store is None else store_file(store)
    return [] if path is None else [path]
