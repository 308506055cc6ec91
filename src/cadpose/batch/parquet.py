"""The annotations of a run as one Parquet table, the same as ``cadpose export parquet`` writes."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator, Sequence
from importlib.util import find_spec
from pathlib import Path

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import sync_folder
from cadpose.batch.outcome import read_document
from cadpose.errors import CadposeError, DependencyError


def need_pyarrow() -> None:
    """Tell before a run, not at its end, what its table needs.

    Raises:
        DependencyError: pyarrow is missing.
    """
    if find_spec("pyarrow") is None:
        raise DependencyError("--parquet needs pyarrow: install it with pip install 'cadpose[parquet]'")


def write_table(documents: Sequence[Path], out: Path) -> None:
    """Write the annotations of documents, read one by one, to a file; the old one stays until all is written.

    Raises:
        DependencyError: pyarrow is missing.
        CadposeError: the file cannot be written.
    """
    from cadpose.annotations.formats.parquet import write
    from cadpose.annotations.formats.sources import Sources

    beside = out.parent / f".cadpose-{secrets.token_hex(8)}.part"
    try:
        try:
            out.parent.mkdir(parents=True, exist_ok=True)
            write(_read(documents), beside, Sources())
            with beside.open("rb+") as file:
                os.fsync(file.fileno())
            beside.replace(out)
            sync_folder(out.parent)
        finally:
            beside.unlink(missing_ok=True)
    except OSError as error:
        raise CadposeError(
            f"cannot write {out}: {error.strerror or error}; choose another place with --parquet"
        ) from None


def _read(documents: Sequence[Path]) -> Iterator[AnnotationDocument]:
    for path in documents:
        document = read_document(path)
        if document is not None:
            yield document
