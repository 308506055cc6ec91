"""Models that are never drawn in training, so that what was learnt can be judged on shapes not seen before.

In every category with at least `LEAST_MODELS` Sweet Home 3D models about a fifth of them is held out. Models
that look alike (`NEAR_DUPLICATE`, or file names that differ by a colour only) are held out together or not at
all. Groups of look-alikes are taken in order of the SHA-256 of their first id: the choice depends on the ids
and shapes of the models alone.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.sampling import shape_descriptor
from cadpose.library.storage import sha256_of
from cadpose.records import CadModel
from cadpose.training.shapes import DATA

LEAST_MODELS = 8
SHARE, FEWEST, MOST = 0.2, 2, 6
NEAR_DUPLICATE = 0.15
"""Descriptor distance of look-alikes; the library's representatives count 0.12 as the same shape."""

_COLOURS = re.compile(
    r"black|white|grey|gray|red|green|blue|yellow|orange|brown|pink|purple|beige|silver"
    r"|alder|pear|teak|oak|walnut|beech|pine"
)


def descriptors(library: Library, models: Sequence[CadModel]) -> NDArray[np.float32]:
    """(N, D) shape descriptors of models (`cadpose.library.sampling.shape_descriptor`)."""
    return np.stack([shape_descriptor(library.mesh(model)) for model in models])


def same_but_colour(cad_id: str) -> str:
    """What is left of a model's file name without words for colours and woods; empty if it has none.

    ``"a/wooden_office_teak_table.obj"`` and ``"a/wooden_office_pear_table.obj"`` give the same.
    """
    stem = cad_id.rsplit("/", 1)[-1].rsplit(".", 1)[0].lower()
    bare = re.sub(r"[\s_\-]+", "", _COLOURS.sub("", stem))
    return bare if bare != re.sub(r"[\s_\-]+", "", stem) else ""


def lookalikes(ids: Sequence[str], rows: NDArray[np.float32]) -> list[list[int]]:
    """Groups of models of one category that look alike, directly or through others.

    Args:
        ids: Model ids.
        rows: (N, D) descriptors.

    Returns:
        Row numbers by group; every model is in one group.
    """
    names = [same_but_colour(i) for i in ids]
    group = list(range(len(ids)))
    for i in range(len(ids)):
        distances = np.linalg.norm(rows[:i] - rows[i], axis=1)
        for j in range(i):
            if distances[j] <= NEAR_DUPLICATE or (names[i] and names[i] == names[j]):
                old, new = group[i], group[j]
                group = [new if g == old else g for g in group]
    return [[i for i, g in enumerate(group) if g == which] for which in sorted(set(group))]


def choose(ids: Sequence[str], rows: NDArray[np.float32]) -> list[str]:
    """The held-out models of one category, in order of id; none where there are too few models.

    Args:
        ids: Ids of the models to choose among.
        rows: (N, D) descriptors.
    """
    if len(ids) < LEAST_MODELS:
        return []
    wanted = min(max(round(SHARE * len(ids)), FEWEST), MOST)
    groups = sorted(
        (sorted(ids[i] for i in group) for group in lookalikes(ids, rows)),
        key=lambda group: sha256_of(group[0].encode()),
    )
    chosen: list[str] = []
    for group in groups:
        # A group may overshoot by one: else pairs would hardly ever be held out.
        if len(chosen) < wanted and len(chosen) + len(group) <= min(wanted + 1, MOST):
            chosen += group
    return sorted(chosen)


def near_duplicates(library: Library, category: str, held_out: Sequence[str]) -> list[str]:
    """Other models of a category that look like one that is held out.

    Raises:
        LibraryError: a held-out model is not in the library, or a mesh is damaged.
    """
    others = [m for m in library.models(category) if m.id not in set(held_out)]
    if not others or not held_out:
        return []
    held = descriptors(library, [library.get(i) for i in held_out])
    rows = descriptors(library, others)
    nearest = np.linalg.norm(rows[:, None] - held[None], axis=2).min(axis=1)
    return [m.id for m, distance in zip(others, nearest, strict=True) if distance <= NEAR_DUPLICATE]


def read_held_out(
    path: Path = DATA / "held-out.json", lookalikes: bool = True
) -> Mapping[str, frozenset[str]]:
    """By category, the ids of all models that training must not draw.

    Args:
        path: The list.
        lookalikes: With the models of other sources that look like a held-out one.

    Raises:
        InputError: the file is not what `scripts/choose_held_out.py` writes.
    """
    try:
        told = json.loads(path.read_text(encoding="utf-8"))
        return {
            str(category): frozenset(
                map(str, [*entry["held_out"], *(entry["lookalikes"] if lookalikes else ())])
            )
            for category, entry in told["categories"].items()
        }
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path} is no list of held-out models ({error!r}).") from error
