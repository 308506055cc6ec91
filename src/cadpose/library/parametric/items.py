"""Parametric models as items of an import, by the same way into the library as files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path

from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES
from cadpose.library.importing import GENERATED, ImportItem
from cadpose.library.parametric.registry import GENERATORS
from cadpose.library.storage import sha256_of

DEFAULT_COUNT = 10
"""Models of a category, unless told."""


@cache
def _fingerprint() -> str:
    """Digest of the generators' source: models are made again when it has changed, and only then."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return sha256_of(b"\0".join(file.read_bytes() for file in files))


def parametric_items(
    categories: tuple[str, ...] | None = None, count: int | Mapping[str, int] | None = None
) -> list[ImportItem]:
    """The first models of each category, seeds 0, 1, 2 ..., with ids such as ``parametric/chair/007``.

    Args:
        categories: Library categories; every one that has a generator by default.
        count: Models a category, a number for all or one a category; `DEFAULT_COUNT` where none is given.

    Raises:
        InputError: a category has no generator, or a count is below one.
    """
    names = tuple(sorted(GENERATORS)) if categories is None else tuple(dict.fromkeys(categories))
    strange = [name for name in names if name not in GENERATORS]
    if strange:
        raise InputError(
            f"There are no parametric models of {', '.join(strange)}; "
            f"there are of {', '.join(sorted(GENERATORS))}."
        )
    items: list[ImportItem] = []
    for name in names:
        number = count if isinstance(count, int) else (count or {}).get(name, DEFAULT_COUNT)
        if number < 1:
            raise InputError(f"{number} parametric models of {name} cannot be made; ask for one or more.")
        items += [_item(name, seed) for seed in range(number)]
    return items


def _item(category: str, seed: int) -> ImportItem:
    display = CATEGORIES[category].display if category in CATEGORIES else category.capitalize()
    return ImportItem(
        id=f"parametric/{category}/{seed:03d}",
        name=f"{display} {seed:03d}",
        category=category,
        container=GENERATED + category,
        member=str(seed),
        fingerprint=_fingerprint(),
        source="parametric",
        licence="CC0-1.0",
        creator="cadpose",
    )
