"""Shapes stay shapes: unit size, unit normals, their symmetry, the order of their surface."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel
from cadpose.rendering.scene import TEXTURED, Scene, build_scene
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.shapes import KeptScenes, redressed, warped
from tests.rendering.shapes import sphere


@pytest.fixture(scope="module")
def car(small_library: Library) -> Scene:
    return build_scene(small_library.mesh("made/car/hatch.obj"))


@pytest.mark.parametrize("seed", range(10))
def test_a_warped_shape_is_centred_and_of_unit_size(car: Scene, seed: int) -> None:
    scene = warped(car, SymmetryGroup.trivial(), np.random.default_rng(seed))
    low, high = scene.vertices.min(axis=0), scene.vertices.max(axis=0)
    np.testing.assert_allclose(low, -high, atol=1e-5)
    assert np.linalg.norm(high - low) == pytest.approx(1.0, abs=1e-5)
    np.testing.assert_allclose(np.linalg.norm(scene.normals, axis=2), 1.0, atol=1e-4)
    np.testing.assert_allclose(scene.corners.max(axis=0), high, atol=1e-6)
    assert np.array_equal(scene.coordinates, scene.vertices.T)
    assert not np.allclose(scene.vertices, car.vertices, atol=0.01)


@pytest.mark.parametrize("seed", range(6))
def test_left_and_right_stay_alike(car: Scene, seed: int) -> None:
    scene = warped(car, SymmetryGroup.trivial(), np.random.default_rng(seed))
    # The middle plane stays flat, and x keeps its sign and order at each height.
    assert np.array_equal(
        np.sign(np.round(scene.vertices[:, 0], 5)), np.sign(np.round(car.vertices[:, 0], 5))
    )


def test_what_is_round_stays_round() -> None:
    ball = build_scene(sphere(0.28, 24))
    for seed in range(6):
        scene = warped(ball, SymmetryGroup.revolution(), np.random.default_rng(seed))
        x, y, z = scene.coordinates
        for level in np.unique(np.round(ball.vertices[:, 1], 4)):
            ring = np.abs(ball.vertices[:, 1] - level) < 1e-3
            assert np.ptp(np.hypot(x[ring], z[ring])) < 1e-3 and np.ptp(y[ring]) < 1e-3


@pytest.mark.parametrize("seed", range(16))
def test_redressing_changes_looks_and_not_the_shape(car: Scene, seed: int) -> None:
    scene = redressed(car, np.random.default_rng(seed), Backdrops())
    assert scene.vertices is car.vertices and scene.faces is car.faces
    assert (scene.rgba[:, :3] >= 0).all() and (scene.rgba[:, :3] <= 255).all()
    assert np.array_equal(scene.rgba[:, 3], car.rgba[:, 3])
    textured = (scene.look & TEXTURED) > 0
    levels = scene.material_levels[scene.material[textured]]
    assert (levels[:, 1] > 0).all() and (levels.sum(axis=1) <= len(scene.levels)).all()
    assert not np.array_equal(scene.rgba, car.rgba) or textured.any()


def test_scenes_are_kept_within_their_bytes(small_library: Library) -> None:
    loaded: list[str] = []

    def mesh(cad: CadModel) -> Mesh:
        loaded.append(cad.id)
        return small_library.mesh(cad)

    cars = small_library.models("car")
    roomy = KeptScenes(mesh, small_library.symmetry, 1 << 30)
    for _ in range(2):
        for cad in cars:
            roomy.of(cad)
    assert len(loaded) == 3
    tight = KeptScenes(mesh, small_library.symmetry, 1)
    for cad in (cars[0], cars[0], cars[1], cars[0]):
        tight.of(cad)
    assert len(loaded) == 6
