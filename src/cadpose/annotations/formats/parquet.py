"""Parquet: the columns of CSV, typed, and the whole annotation as JSON beside them."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.extras import extras_of
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import dumped
from cadpose.annotations.formats.rows import COLUMNS, Row, documents_of, rows_of
from cadpose.annotations.formats.sources import Sources
from cadpose.errors import DependencyError, InputError

#: The annotation as JSON, without its mask, which has a column.
DOCUMENT = "annotation"
_WHAT = "a Parquet file of `cadpose export parquet`"
_GROUP = 1000
_BATCH = 200
_MAX_DOCUMENT = 64_000_000


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Write one Parquet file; a row group is held in memory at a time.

    Raises:
        DependencyError: pyarrow is missing.
    """
    pa, pq = _pyarrow()
    kinds = {str: pa.string(), int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    schema = pa.schema([*((n, kinds[kind]) for n, kind in COLUMNS.items()), (DOCUMENT, pa.string())])
    with pq.ParquetWriter(out, schema, compression="zstd") as table:
        group: list[Row] = []
        for document in documents:
            for row, part in rows_of(document):
                group.append(row | {DOCUMENT: dumped(extras_of(part))})
                if len(group) == _GROUP:
                    table.write_table(pa.Table.from_pylist(group, schema))
                    group = []
        if group:
            table.write_table(pa.Table.from_pylist(group, schema))


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a file; boxes, categories and masks as the columns tell them.

    Raises:
        DependencyError: pyarrow is missing.
        InputError: the file is not one that `write` wrote.
    """
    yield from documents_of(_rows(path), _extras)


def _rows(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    pa, pq = _pyarrow()
    try:
        with pq.ParquetFile(path) as file:
            missing = [name for name in (*COLUMNS, DOCUMENT) if name not in file.schema_arrow.names]
            if missing:
                raise InputError(f"{path} is not {_WHAT}: it has no column {missing[0]}")
            number = 0
            for batch in file.iter_batches(_BATCH, columns=[*COLUMNS, DOCUMENT]):
                for row in batch.to_pylist():
                    number += 1
                    yield f"{path}: row {number}", row
    except (OSError, pa.ArrowException) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0][:120]
        raise InputError(f"{path} cannot be read ({reason}): name {_WHAT}") from error


def _extras(row: Mapping[str, Any], where: str) -> dict[str, Any]:
    text = row[DOCUMENT]
    try:
        if not isinstance(text, str) or len(text) > _MAX_DOCUMENT:
            raise ValueError("missing or too long")
        told = json.loads(text)
        if not isinstance(told, dict):
            raise ValueError("no object")
    except (ValueError, RecursionError) as error:
        raise InputError(f"{where} has an unusable {DOCUMENT} ({error})") from None
    return told


def _pyarrow() -> tuple[Any, Any]:
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError:
        raise DependencyError(
            "Parquet needs pyarrow: install it with pip install 'cadpose[parquet]', or export as csv"
        ) from None
    return pyarrow, pyarrow.parquet


PARQUET = Format("parquet", "Parquet, one row an annotation", False, write, read)
