"""CSV: one row an annotation, for spreadsheets and data frames."""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.rows import COLUMNS, Cell, documents_of, extras_from_row, rows_of
from cadpose.annotations.formats.sources import Sources
from cadpose.errors import InputError

#: Longest cell that is read, in characters: masks are long.
MAX_CELL = 16_000_000
_WHAT = "a CSV file of `cadpose export csv`"


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Write one CSV file, UTF-8."""
    with out.open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file)
        table.writerow(COLUMNS)
        for document in documents:
            for row, _ in rows_of(document):
                table.writerow([_text(cell) for cell in row.values()])


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a file.

    Raises:
        InputError: the file is not one that `write` wrote, or a cell is wrong.
    """
    # A limit of the whole process: only ever raised.
    csv.field_size_limit(max(csv.field_size_limit(), min(MAX_CELL, sys.maxsize)))
    yield from documents_of(_rows(path), lambda row, where: extras_from_row(row, "csv"))


def _rows(path: Path) -> Iterator[tuple[str, Mapping[str, Any]]]:
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            table = csv.DictReader(file)
            missing = [name for name in COLUMNS if name not in (table.fieldnames or ())]
            if missing:
                raise InputError(f"{path} is not {_WHAT}: it has no column {missing[0]}")
            for row in table:
                where = f"{path}: line {table.line_num}"
                yield where, {name: _cell(name, row[name], where) for name in COLUMNS}
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error).splitlines()[0]
        raise InputError(f"{path} cannot be read ({reason}): name {_WHAT}") from error


def _text(cell: Cell) -> str:
    if cell is None:
        return ""
    if isinstance(cell, bool):
        return "true" if cell else "false"
    return repr(cell) if isinstance(cell, float) else str(cell)


def _cell(name: str, text: str | None, where: str) -> Cell:
    kind = COLUMNS[name]
    if text is None:
        raise InputError(f"{where} is too short: export it again")
    if kind is str:
        # An empty text and none look alike; only these three may be none.
        return text or (None if name in ("verdict", "mask") else "")
    if not text:
        return None
    try:
        if kind is bool:
            return {"true": True, "false": False}[text.lower()]
        return int(text) if kind is int else float(text)
    except (KeyError, ValueError):
        raise InputError(f"{where}: {name} is {text[:40]!r}, which is no {kind.__name__}") from None


CSV = Format("csv", "CSV, one row an annotation", False, write, read)
