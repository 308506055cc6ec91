"""Photo-like synthetic photos for the paper's set-up: of every model as many as of the others."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from cadpose.datasets.labels import read_labels, write_labels
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.drawers import Drawer
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.records import SynthPhoto
from cadpose.training.synth.writer import LABELS, write_photos

#: Strength of the shape warps at which an axis is scaled by at most 10 %: 2.5 sigma, sigma 0.13 · strength.
WARP = 0.3
#: Folder of the photos, one folder a category in it.
PHOTOS = "photos"


def photo_options(size: int) -> SynthOptions:
    """One whole object a photo; every photo has a shape, colours and light of its own.

    Args:
        size: Side of a photo in pixels.
    """
    return SynthOptions(
        size=size, series=1, shapes=1, fill=(0.55, 0.95), warp=WARP, redress=1.0, company=0.0, occluder=0.0,
        truncate=0.0, backdrop_photo=0.9,
    )  # fmt: skip


class InTurn(SynthGenerator):
    """Photo number i shows model i modulo their number, so that each is seen as often as the others."""

    def __init__(
        self,
        models: Sequence[CadModel],
        mesh: Callable[[CadModel], Mesh],
        symmetry: Callable[[CadModel], SymmetryGroup],
        backdrops: Backdrops,
        options: SynthOptions,
        seed: int,
        drawer: Drawer,
    ) -> None:
        super().__init__(models, mesh, symmetry, backdrops, options, seed, drawer)
        self._each = [
            SynthGenerator([model], mesh, symmetry, backdrops, options, seed, drawer) for model in models
        ]

    def photo(self, index: int) -> SynthPhoto:
        """Photo number ``index``."""
        return self._each[index % len(self._each)].photo(index)


@dataclass(frozen=True)
class InTurnRecipe(Recipe):
    """A recipe whose models are drawn in turn."""

    _made: ClassVar[type[SynthGenerator]] = InTurn

    def to_json(self) -> dict[str, Any]:
        """What decides the photos' bytes."""
        return {**super().to_json(), "in_turn": True}


def paper_recipes(base: Recipe, gallery: Mapping[str, Sequence[CadModel]]) -> dict[str, InTurnRecipe]:
    """One recipe a category, each with a seed of its own so that no two categories share their views.

    Args:
        base: Library, backdrops, options, renderer and seed of all.
        gallery: The models by category.
    """
    recipes = {}
    for category, models in gallery.items():
        seed = np.random.SeedSequence((base.seed, zlib.crc32(category.encode()))).generate_state(1)[0]
        own = replace(base, models=tuple(model.id for model in models), seed=int(seed))
        recipes[category] = InTurnRecipe(**vars(own))
    return recipes


def draw_paper_photos(
    recipes: Mapping[str, Recipe],
    out: Path,
    photos: int,
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> Path:
    """Draw the photos of every category and put their labels into one file.

    Args:
        recipes: By category.
        out: Folder; the photos go to ``out/photos/CATEGORY``.
        photos: Photos a category.
        workers: Processes.
        resume: Go on with a folder of the same recipes.
        progress: Told (photos done, photos in all).

    Returns:
        The label file, ``out/labels.jsonl``.

    Raises:
        InputError: a category's folder is another run's.
        CadposeError: a worker was killed, or a model cannot be read.
    """
    labels = []
    for number, (category, recipe) in enumerate(recipes.items()):
        folder = out / PHOTOS / category
        before = number * photos

        def told(done: int, total: int, before: int = before) -> None:
            progress(before + done, len(recipes) * photos)

        write_photos(recipe, folder, photos, workers=workers, resume=resume, progress=told)
        labels += read_labels(folder / LABELS)
    write_labels(out / LABELS, labels)
    return out / LABELS
