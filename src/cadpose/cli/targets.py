"""Files that a command is told to write: none over what it reads, none over another."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from pathlib import Path

from cadpose.errors import InputError


def check_targets(
    files: Sequence[tuple[str, Path | None]], own: Sequence[tuple[str, Path]], inputs: Iterable[Path]
) -> None:
    """Refuse what would be written over, before anything is.

    Places are compared, not spellings: links and ``..`` hide nothing.

    Args:
        files: (option, file) that the user names; None where the option was not given.
        own: (option, path) that the command names itself, in a folder that the option gives.
        inputs: What is read; the user's files may not lie in a folder of these.

    Raises:
        InputError: a file is a folder, an input or another target; the message names the option.
    """
    read = {_place(path) for path in inputs}
    taken: dict[Path, str] = {}
    named = [(option, path) for option, path in files if path is not None]
    for option, path in named:
        if path.is_dir():
            raise InputError(f"{path} is a folder: name a file with {option}")
        if folders := read.intersection(_place(path).parents):
            raise InputError(f"{path} lies in {folders.pop()}, which this run reads: choose another {option}")
    for option, path in (*own, *named):
        place = _place(path)
        if place in read:
            raise InputError(
                f"{path} is an input of this run and would be written over: choose another {option}"
            )
        other = taken.get(place)
        if other is not None:
            raise InputError(f"{path} is written for {other} already: choose another {option}")
        taken[place] = option


def _place(path: Path) -> Path:
    return Path(os.path.realpath(path))
