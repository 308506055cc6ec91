"""What every verb shares: stdout is data, stderr is log, one sentence for a user's mistake."""

from __future__ import annotations

import json
import logging
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer
from rich.console import Console
from rich.logging import RichHandler
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from cadpose.errors import CadposeError

stdout = Console()
stderr = Console(stderr=True)


def set_up_logging(verbose: bool) -> None:
    """Log to stderr: warnings, or everything when ``verbose``."""
    handler = RichHandler(console=stderr, show_time=False, show_path=False, markup=False)
    logging.basicConfig(level=logging.WARNING, format="%(message)s", handlers=[handler], force=True)
    logging.getLogger("cadpose").setLevel(logging.DEBUG if verbose else logging.WARNING)


def print_json(value: Any) -> None:
    """One JSON value on stdout."""
    sys.stdout.write(json.dumps(value, ensure_ascii=False, allow_nan=False) + "\n")


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout; the first column is left-aligned, the others right-aligned."""
    table = Table(title=title, title_justify="left", title_style="bold")
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right", overflow="fold")
    for row in rows:
        table.add_row(*(str(cell) for cell in row))
    stdout.print(table)


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn a :class:`CadposeError` into one sentence on stderr and exit code 1."""
    try:
        yield
    except CadposeError as error:
        stderr.print(f"cadpose: {error}", markup=False, highlight=False, soft_wrap=True)
        raise typer.Exit(1) from error
    except KeyboardInterrupt as error:
        stderr.print("cadpose: stopped")
        raise typer.Exit(130) from error


@contextmanager
def progress_bar(what: str, total: int | None) -> Iterator[Progress]:
    """A bar on stderr; nothing is drawn when stderr is not a terminal. Advance task 0."""
    bar = Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeRemainingColumn(),
        console=stderr,
        disable=not stderr.is_terminal,
        transient=True,
    )
    with bar:
        bar.add_task(what, total=total)
        yield bar
