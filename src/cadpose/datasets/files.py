"""Reading what others wrote: nothing is decoded before its size is known, no path leaves its folder."""

from __future__ import annotations

import itertools
import json
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from cadpose.errors import InputError

#: Largest JSON file that is read; it is held in memory as a whole.
MAX_BYTES = 256 * 2**20
#: Largest JSONL file, and the longest of its lines (a mask as run lengths takes some kB).
MAX_JSONL_BYTES = 2 * 2**30
MAX_LINE_BYTES = 4 * 2**20


def read_json(path: Path) -> Any:
    """The value that a JSON file holds.

    Raises:
        InputError: it cannot be read, is too large, or is not JSON.
    """
    return _decoded(read_bytes(path, MAX_BYTES), str(path))


def json_lines(path: Path) -> Iterator[tuple[int, Any]]:
    """(line number from 1, value) of every line that is not blank.

    Raises:
        InputError: the file cannot be read, it or a line is too large, or a line is not JSON.
    """
    read = 0
    with _opened(path) as file:
        for number in itertools.count(1):
            line = file.readline(MAX_LINE_BYTES + 1)
            if not line:
                return
            read += len(line)
            where = f"{path}: line {number}"
            if len(line) > MAX_LINE_BYTES:
                most = f"{MAX_LINE_BYTES >> 20} MiB"
                raise InputError(f"{where} is longer than {most}, write one object a line")
            if read > MAX_JSONL_BYTES:
                raise _too_large(path, MAX_JSONL_BYTES)
            if line.strip():
                yield number, _decoded(line, where)


def read_bytes(path: Path, most: int) -> bytes:
    """A file's bytes.

    Raises:
        InputError: it cannot be read, is no regular file, or has more than ``most`` bytes.
    """
    with _opened(path) as file:
        # A file's size may be told wrong, as in /proc, or grow.
        data = file.read(most + 1)
    if len(data) > most:
        raise _too_large(path, most)
    return data


def read_words(path: Path) -> list[list[str]]:
    """The words of every line that is not blank, as in a data set's list of photos.

    Raises:
        InputError: the file cannot be read, is too large, or is not UTF-8.
    """
    try:
        lines = read_bytes(path, MAX_BYTES).decode("utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not a list of photos ({error})") from error
    return [line.split() for line in lines if line.strip()]


def inside(root: Path, name: str, where: Path) -> Path:
    """A path that a data set names, within its folder.

    Args:
        root: The folder.
        name: As the data set writes it, with forward slashes.
        where: The file that names it, for the message.

    Raises:
        InputError: the name is empty or leads out of the folder.
    """
    parts = name.split("/")
    if not all(parts) or {".", ".."} & set(parts) or any(c in name for c in "\\:\0"):
        raise InputError(f"{where}: names the file {name[:80]!r}, which does not lie in {root}")
    return root.joinpath(*parts)


def first_line(error: BaseException) -> str:
    """What an error says, short enough for a sentence."""
    return (str(error) or type(error).__name__).splitlines()[0][:120]


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    try:
        # Looked at before it is opened: opening a pipe would wait for a writer.
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path}: cannot be read (not a regular file), check the path")
        file = path.open("rb")
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        reason = error.strerror if isinstance(error, OSError) else error
        raise InputError(f"{path}: cannot be read ({reason}), check the path") from error
    with file:
        yield file


def _too_large(path: Path, most: int) -> InputError:
    return InputError(f"{path}: larger than {max(most >> 20, 1)} MiB, split it into several files")


def _decoded(data: bytes, where: str) -> Any:
    try:
        return json.loads(data.decode("utf-8"))
    except (ValueError, RecursionError) as error:  # bad UTF-8, bad JSON, endless digits or brackets
        raise InputError(f"{where}: is not valid JSON ({error})") from error
