"""Photos of the paper's set-up: every model in turn, and the same photos again."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.datasets.labels import read_labels
from cadpose.errors import InputError
from cadpose.evaluation.paper_photos import (
    WARP,
    InTurnRecipe,
    draw_paper_photos,
    paper_recipes,
    photo_options,
)
from cadpose.library.catalogue import Library
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.shapes import warped


def recipes_of(library: Library, seed: int = 0) -> dict[str, InTurnRecipe]:
    base = Recipe.from_library(library, options=photo_options(64), seed=seed)
    gallery = {category: library.models(category)[:2] for category in ("car", "chair")}
    return paper_recipes(base, gallery)


def test_every_model_is_seen_as_often_as_the_others(small_library: Library, tmp_path: Path) -> None:
    told: list[tuple[int, int]] = []
    path = draw_paper_photos(
        recipes_of(small_library), tmp_path, 4, progress=lambda done, total: told.append((done, total))
    )
    labels = read_labels(path)
    assert [label.photo.parent.parent.name for label in labels] == ["car"] * 4 + ["chair"] * 4
    assert [label.cad for label in labels] == [
        *["made/car/hatch.obj", "made/car/pickup.obj"] * 2,
        *["made/chair/plain.obj", "made/chair/throne.glb"] * 2,
    ]  # fmt: skip
    assert all(label.synthetic and label.photo.is_file() and not label.truncated for label in labels)
    # No two photos share their view, not even photos of the same number in two categories.
    assert len({label.azimuth for label in labels}) == 8
    assert told[-1] == (8, 8)


def test_the_same_photos_again(small_library: Library, tmp_path: Path) -> None:
    recipes = recipes_of(small_library)
    path = draw_paper_photos(recipes, tmp_path, 4)
    photo = tmp_path / "photos" / "chair" / "photos" / "0000001.jpg"
    before, labels = photo.read_bytes(), path.read_bytes()
    with pytest.raises(InputError, match="add --resume"):
        draw_paper_photos(recipes, tmp_path, 4)
    photo.unlink()
    draw_paper_photos(recipes, tmp_path, 4, resume=True)
    assert photo.read_bytes() == before and path.read_bytes() == labels
    other = recipes_of(small_library, seed=1)["chair"].generator().photo(1)
    assert not np.array_equal(other.rgb, recipes["chair"].generator().photo(1).rgb)
    assert recipes["car"].to_json()["in_turn"] is True


def test_axes_are_scaled_by_about_ten_per_cent_at_most(small_library: Library) -> None:
    generator = recipes_of(small_library)["car"].generator()
    scene, symmetry = generator._scenes.of(small_library.get("made/car/hatch.obj"))
    sides = np.ptp(scene.vertices, axis=0)
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(200):
        changed = np.ptp(warped(scene, symmetry, rng, WARP).vertices, axis=0) / sides
        # Shapes have a unit diagonal: proportions are what counts.
        ratios.append(changed / np.exp(np.log(changed).mean()))
    assert 1.05 < np.max(ratios) < 1.16 and 0.86 < np.min(ratios) < 0.95
