"""The folder of one training: it is not written over, and goes on with the same settings only."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.library.storage import write_atomic

SETTINGS = "settings.json"


def begin(folder: Path, settings: Mapping[str, Any], resume: bool) -> None:
    """Write the settings of a new training, or compare them with those of the one to go on with.

    Raises:
        InputError: the folder holds a training and ``resume`` is not told, or holds none and it is, or the
            settings were others.
    """
    path = folder / SETTINGS
    plain = json.loads(json.dumps(settings))
    if not resume:
        if path.exists():
            raise InputError(f"{folder}: holds a training already, add --resume or name another folder")
        write_atomic(path, (json.dumps(plain, indent=1) + "\n").encode("ascii"))
        return
    if not path.is_file():
        raise InputError(f"{folder}: holds no training to resume, leave out --resume")
    try:
        was = dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{path} is damaged ({error}): start anew in another folder") from error
    changed = sorted(key for key in {*was, *plain} if was.get(key) != plain.get(key))
    if changed:
        raise InputError(
            f"{folder}: was begun with other {', '.join(changed)}: "
            "resume with the same, or name another folder"
        )
