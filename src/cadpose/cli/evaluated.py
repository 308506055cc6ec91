"""What the ``evaluate`` verbs have in common: options, and how they tell what came of it."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, Protocol

import typer

from cadpose.cli.output import complain, print_json

LabelCategory = Annotated[str | None, typer.Option("--category", help="Only labels of this category.")]
SpreadSplit = Annotated[
    str, typer.Option("--split", help="odd or even ones of each category, all, or a split of the labels.")
]
Csv = Annotated[Path | None, typer.Option("--csv", help="CSV file with the tables.")]
OutlineReport = Annotated[
    Path | None,
    typer.Option("--report", help="Folder of a page, tables, outcomes and sheets of outlines."),
]


class Tables(Protocol):
    """Tables of one evaluation."""

    def to_text(self) -> str:
        """For a terminal, with the last line's end."""
        ...

    def to_csv(self) -> str:
        """For a spreadsheet."""
        ...

    def to_json(self) -> dict[str, Any]:
        """For programs."""
        ...


def name_unused(failed: Iterable[tuple[str, str]]) -> None:
    """Name each (photo, reason) on stderr."""
    for photo, reason in failed:
        complain(reason if photo in reason else f"{photo}: {reason}")


def write_csv(path: Path | None, tables: Tables) -> None:
    """Write the tables where a file is named."""
    from cadpose.library.storage import write_atomic

    if path is not None:
        write_atomic(path, tables.to_csv().encode("utf-8", "backslashreplace"))


def print_tables(tables: Tables, json: bool, report: Path | None) -> None:
    """The tables on stdout, and where the report is."""
    if json:
        print_json(tables.to_json())
        return
    typer.echo(tables.to_text(), nl=False)
    if report is not None:
        typer.echo(f"\nReport: {report}")
