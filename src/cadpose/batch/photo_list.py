"""Photos named by a list, one path a line, as ``find photos -name '*.jpg'`` writes it."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import BinaryIO

from cadpose.errors import InputError
from cadpose.photos import find_photos

#: Longest list, and longest line of one, in bytes.
MAX_BYTES, MAX_LINE = 256 * 2**20, 4096
#: Most photos of one list.
MAX_PHOTOS = 2_000_000
_SUFFIX = ".txt"
_STDIN = "-"


def named_photos(args: Sequence[str]) -> list[Path]:
    """The photos that PHOTO, DIR, GLOB, list and ``-`` arguments stand for, each once.

    A file whose name ends in ``.txt`` is a list, ``-`` a list on stdin; see :func:`read_list`.

    Raises:
        InputError: an argument stands for no photo, or a list cannot be used.
    """
    if args.count(_STDIN) > 1:
        raise InputError("- was given more than once: stdin can be read only once.")
    found: dict[Path, Path] = {}
    for arg in args:
        if arg == _STDIN:
            paths = read_list(sys.stdin.buffer, "the list on stdin")
        elif Path(arg).suffix.lower() == _SUFFIX and Path(arg).is_file():
            try:
                with Path(arg).open("rb") as file:
                    paths = read_list(file, arg)
            except OSError as error:
                raise InputError(
                    f"{arg} cannot be opened ({error.strerror}): check its permissions."
                ) from None
        else:
            paths = find_photos([arg])
        for path in paths:
            found.setdefault(path.resolve(), path)
    return list(found.values()) or find_photos([])


def read_list(file: BinaryIO, name: str) -> list[Path]:
    """The paths of a list: one a line, in any encoding that file names may have, empty lines passed over.

    Paths are relative to the current folder. Whether a file is there is found out when its photo is read:
    one that is missing is a failure of that photo, not of the list.

    Args:
        file: Where to read it from.
        name: What to call it in messages.

    Raises:
        InputError: it is empty, too long, or holds something else than paths.
    """
    paths: list[Path] = []
    read = number = 0
    while line := file.readline(MAX_LINE + 2):
        number += 1
        read += len(line)
        text = line.removeprefix(b"\xef\xbb\xbf" if number == 1 else b"").rstrip(b"\r\n")
        if b"\0" in text:
            raise InputError(f"{name}, line {number}: not a path; a list holds one path a line.")
        if len(text) > MAX_LINE:
            raise InputError(f"{name}, line {number}: longer than {MAX_LINE} bytes, no path is.")
        if read > MAX_BYTES or len(paths) >= MAX_PHOTOS:
            raise InputError(
                f"{name} is longer than {MAX_PHOTOS:,} paths or {MAX_BYTES // 2**20} MB: cut it into several."
            )
        if text.strip():
            paths.append(Path(os.fsdecode(text)))
    if not paths:
        raise InputError(f"{name} names no photo: write one path a line.")
    return paths
