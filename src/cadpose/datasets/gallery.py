"""Gallery files: which CAD models a photo's object is to be found among."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.datasets.files import read_json
from cadpose.datasets.label_json import library_category
from cadpose.errors import InputError
from cadpose.library.storage import write_atomic


@dataclass(frozen=True)
class Gallery:
    """CAD ids to choose among.

    Attributes:
        path: The file, for messages.
        ids: All of them, in the file's order, each once.
        category_of: What category the file names each id under; empty where it is a plain list, and a model
            then stands under its category in the library.
    """

    path: Path
    ids: tuple[str, ...]
    category_of: Mapping[str, str]


def read_gallery(path: Path) -> Gallery:
    """Read a JSON array of library ids, or an object from category to such an array.

    A category may be a word for it ("motorcycle"). An id that is named twice in a category counts once.

    Raises:
        InputError: the file cannot be read, is neither form, or names an id under two categories.
    """
    content = read_json(path)
    if _is_ids(content):
        return Gallery(path, tuple(dict.fromkeys(content)), {})
    if not isinstance(content, dict) or not content or not all(map(_is_ids, content.values())):
        raise InputError(
            f"{path}: expected a JSON array of CAD ids as `cadpose library list --json` prints them, or an "
            "object from category to such an array"
        )
    category_of: dict[str, str] = {}
    for word, ids in content.items():
        category = library_category(word)
        for cad in ids:
            if category_of.setdefault(cad, category) != category:
                raise InputError(f"{path}: names {cad} under {category_of[cad]} and under {category}")
    return Gallery(path, tuple(category_of), category_of)


def write_gallery(path: Path, ids: Mapping[str, Sequence[str]]) -> None:
    """Write the form with categories; the file is whole or not there.

    Raises:
        OSError: it cannot be written.
    """
    told = {category: list(some) for category, some in ids.items()}
    write_atomic(path, (json.dumps(told, indent=1) + "\n").encode("ascii"))


def _is_ids(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(i, str) and i for i in value)
