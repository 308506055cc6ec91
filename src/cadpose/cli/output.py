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
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from cadpose.errors import CadposeError

stderr = Console(stderr=True)

#: A table that goes into a file or a pipe is as wide as its cells.
_UNBOUNDED = 10_000


class _OneLine(logging.Handler):
    """Log records on stderr in the words of :func:`complain`, with the traceback where there is one."""

    def emit(self, record: logging.LogRecord) -> None:
        complain(record.getMessage())
        if record.exc_info:
            stderr.out(logging.Formatter().formatException(record.exc_info), highlight=False)


def set_up_logging(verbose: bool) -> None:
    """Log to stderr: warnings, or everything of cadpose when ``verbose``."""
    logging.basicConfig(level=logging.WARNING, handlers=[_OneLine()], force=True)
    logging.getLogger("cadpose").setLevel(logging.DEBUG if verbose else logging.WARNING)


def complain(sentence: str) -> None:
    """One line on stderr, however long."""
    stderr.print(f"cadpose: {_plain(sentence)}", markup=False, highlight=False, soft_wrap=True)


def print_json(value: Any) -> None:
    """One JSON value on stdout."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    try:
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:  # a file name that is no text, or a terminal that knows ASCII only
        text = json.dumps(value, allow_nan=False)
    typer.echo(text)


def print_table(title: str, columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout; the first column is left-aligned and kept whole, the others right-aligned."""
    stdout = Console()
    if not stdout.is_terminal:
        stdout = Console(width=_UNBOUNDED)
    table = Table(title=Text(title), title_justify="left", title_style="bold")
    for i, column in enumerate(columns):
        names = max((len(row[i]) for row in rows), default=0)
        keep = i == 0 and names <= stdout.width // 2
        table.add_column(column, justify="left" if i == 0 else "right", overflow="fold", no_wrap=keep)
    for row in rows:
        # As Text, because a name may hold what rich takes for markup.
        table.add_row(*(Text(_plain(cell)) for cell in row))
    stdout.print(table)


def _plain(text: str) -> str:
    """Names of files and models are their authors' words: nothing that steers a terminal comes through."""
    return "".join(c if c.isprintable() else " " if c.isspace() else "?" for c in text)


@contextmanager
def user_errors() -> Iterator[None]:
    """Turn what a user can mend into one sentence on stderr and exit code 1, and Ctrl-C into 130."""
    try:
        yield
    except CadposeError as error:
        complain(str(error))
        raise typer.Exit(1) from error
    except BrokenPipeError:  # `| head`: whoever started the command line ends it without a word
        raise
    except OSError as error:
        place = "" if error.filename is None else f"{error.filename}: "
        complain(f"{place}{error.strerror or error}")
        raise typer.Exit(1) from error
    except KeyboardInterrupt as error:
        complain("stopped")
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
