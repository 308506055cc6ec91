"""From a CAD library to what is drawn in training, and what is only measured on."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.sweethome3d_exceptions import read_exceptions
from cadpose.photos import find_photos
from cadpose.records import CadModel
from cadpose.training.held_out import near_duplicates, read_held_out
from cadpose.training.lite.stream import Source
from cadpose.training.shapes import LEFT_OUT
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe

#: Side of the photos; crops are 224 px.
SIZE = 256
#: Seed of the photos of unseen models, the same for every training.
UNSEEN_SEED = 77
#: Photos of unseen models that are measured on.
UNSEEN_PHOTOS = 14 * 96


@dataclass(frozen=True)
class Sources:
    """What a training draws.

    Attributes:
        train: Models to learn from.
        unseen: Held-out models, None where the library has none.
    """

    train: Source
    unseen: Source | None

    def to_json(self) -> dict[str, Any]:
        """What decides the photos, wherever library and backdrops lie."""
        return {
            "categories": list(self.train.categories),
            "drawn": _told(self.train),
            "unseen": self.unseen and _told(self.unseen),
        }


#: How often what is photographed most is drawn, and what is hard to tell the front of.
_WEIGHTS = {
    "car": 75.0, "chair": 50.0, "sofa": 35.0, "bed": 35.0, "table": 32.0, "cabinet": 32.0, "lamp": 24.0,
    "sink": 16.0, "bottle": 16.0,
}  # fmt: skip


def drawn_options(counts: Mapping[str, int]) -> SynthOptions:
    """What is drawn: cars and furniture most; of n models of any other category min(12, √n) parts.

    Seldom degraded: what tells a car's front from its back is lost in a blurred photo, and crops are degraded
    once more in training.
    """
    weights = {c: _WEIGHTS.get(c, min(12.0, math.sqrt(n))) for c, n in counts.items()}
    return SynthOptions(size=SIZE, weights=weights, redress=0.5, degrade=0.12)


def sources(library: Library, backgrounds: Path | None, seed: int = 0, *, frontless: bool = False) -> Sources:
    """What to draw of a library. Held-out models and those that look like one are never learned from.

    Sweet Home 3D models that are unfit or still in a category known to be wrong are left out.

    Args:
        library: CAD models.
        backgrounds: Folder of photos to cut backdrops from, None for made-up ones.
        seed: Of the photos to learn from.
        frontless: Draw models of categories without a front (``LEFT_OUT``) too.

    Raises:
        InputError: no model is left to learn from, or ``backgrounds`` holds no photo.
        LibraryError: a mesh is damaged.
    """
    if backgrounds is not None:
        if not backgrounds.is_dir():
            raise InputError(f"there is no folder {backgrounds}: name one with photos for backdrops")
        find_photos([backgrounds])
    usable = _usable(library, frontless)
    counts = dict(sorted(Counter(m.category for m in usable).items()))
    shown = {i for ids in read_held_out(lookalikes=False).values() for i in ids}
    never = {i for ids in read_held_out().values() for i in ids}
    held = [m for m in usable if m.id in shown]
    for category in sorted({m.category for m in held}):
        own = [m.id for m in held if m.category == category]
        never |= set(near_duplicates(library, category, own))
    train = tuple(m.id for m in usable if m.id not in never)
    if not train:
        raise InputError(
            f"the library {library.path} has no model to train on: add some with `cadpose library add`, or "
            "gather the training library as docs/training-shapes.md tells"
        )
    names = tuple(counts)
    quiet = SynthOptions(size=SIZE, company=0.1, truncate=0.03)
    return Sources(
        Source(library.path, train, backgrounds, names, drawn_options(counts), seed),
        Source(library.path, tuple(m.id for m in held), backgrounds, names, quiet, UNSEEN_SEED)
        if held
        else None,
    )


def _usable(library: Library, frontless: bool) -> list[CadModel]:
    unfit = {e.id for e in read_exceptions() if e.problem == "unfit"}
    right = {e.id: e.detail for e in read_exceptions() if e.problem == "category"}
    return [
        m
        for m in library.models()
        if (frontless or m.category not in LEFT_OUT)
        and m.id not in unfit
        and right.get(m.id, m.category) == m.category
    ]


def _told(source: Source) -> dict[str, Any]:
    return Recipe(source.library, source.models, source.backdrops, source.options, source.seed).to_json()
