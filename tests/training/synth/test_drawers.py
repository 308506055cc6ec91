"""Rasteriser and Blender see the same; made-up light is light."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cadpose.errors import DependencyError, InputError
from cadpose.library.catalogue import Library
from cadpose.records import Mask
from cadpose.rendering.blender import blender_python
from cadpose.rendering.blender_worker_photo import mean_radiance
from cadpose.training.synth.drawers import BlenderDrawer, random_surface
from cadpose.training.synth.environments import hdri_files, made_up
from cadpose.training.synth.recipe import Recipe
from tests.training.synth.making import recipe_of


def grown(mask: Mask) -> Mask:
    """A pixel more to every side."""
    return np.asarray(cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0)


@pytest.mark.parametrize("seed", range(12))
def test_made_up_light(seed: int) -> None:
    light = made_up(np.random.default_rng(seed))
    assert light.shape == (128, 256, 3) and light.dtype == np.float32
    assert np.isfinite(light).all() and light.min() > 0.0
    assert 0.05 < mean_radiance(light) < 20.0
    assert np.array_equal(light, made_up(np.random.default_rng(seed)))


def test_surfaces_vary() -> None:
    rng = np.random.default_rng(0)
    surfaces = [random_surface(rng) for _ in range(400)]
    assert 20 < sum(s.metallic > 0 for s in surfaces) < 90
    assert 30 < sum(s.coat > 0 for s in surfaces) < 130
    assert np.std([s.roughness for s in surfaces]) > 0.1


def test_panoramas_are_found(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no folder"):
        hdri_files(tmp_path / "none")
    with pytest.raises(InputError, match=r"holds no \.hdr"):
        hdri_files(tmp_path)
    for name in ("b.exr", "a.HDR", "c.txt"):
        (tmp_path / name).write_bytes(b"x")
    assert [p.name for p in hdri_files(tmp_path)] == ["a.HDR", "b.exr"]


def test_panoramas_are_for_blender(small_library: Library, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--renderer blender"):
        Recipe.from_library(small_library, hdri=tmp_path)


def test_without_blender_one_sentence(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CADPOSE_BLENDER", str(tmp_path))
    with pytest.raises(DependencyError, match="cadpose blender setup"):
        Recipe.from_library(small_library, renderer="blender")


@pytest.mark.slow
def test_labels_do_not_depend_on_the_renderer(small_library: Library) -> None:
    try:
        blender_python()
    except DependencyError as error:
        pytest.skip(str(error))
    recipe = recipe_of(small_library, size=192)
    generator = replace(recipe, renderer="blender", samples=8).generator()
    ours, drawn, large = recipe.generator(), [], 0
    for index in (0, 1, 2, 13):
        one, other = ours.photo(index), generator.photo(index)
        drawn.append(other.rgb)
        assert len(one.objects) == len(other.objects) > 0
        assert not np.array_equal(one.rgb, other.rgb)
        for a, b in zip(one.objects, other.objects, strict=True):
            assert (a.cad, a.rotation, a.focal_px, a.principal_px) == (
                b.cad, b.rotation, b.focal_px, b.principal_px,
            )  # fmt: skip
            assert a.box == b.box and a.truncated == b.truncated
            if a.occluded:  # slivers between others come and go
                continue
            # They part where half a pixel is covered: at most a pixel apart, however long the outline.
            for mine, yours in ((a.mask, b.mask), (b.mask, a.mask)):
                assert (mine & ~grown(yours)).sum() <= 0.005 * mine.sum()
            if a.mask.sum() > 5000:
                large += 1
                assert (a.mask & b.mask).sum() / (a.mask | b.mask).sum() > 0.97
    assert isinstance(generator.drawer, BlenderDrawer) and large >= 2
    # In whatever order.
    again = generator.photo(1).rgb
    generator.drawer.close()
    assert np.abs(again.astype(int) - drawn[1]).max() <= 1
