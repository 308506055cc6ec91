from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES
from cadpose.library.mesh import Mesh
from cadpose.library.parametric.chairs import KINDS
from cadpose.library.parametric.registry import GENERATORS, make

SEEDS = range(12)
MOST_FACES, FEWEST_FACES = 12_000, 200
# A person sits or lies with the back to +z: what is high lies behind what is low.
HIGH_BEHIND = {"chair", "sofa", "bed"}


@pytest.fixture(scope="module", params=sorted(GENERATORS))
def drawn(request: pytest.FixtureRequest) -> tuple[str, list[Mesh]]:
    return request.param, [make(request.param, seed) for seed in SEEDS]


def test_every_category_is_one_of_the_library() -> None:
    assert set(GENERATORS) <= set(CATEGORIES)


def test_models_are_normalised_and_modest(drawn: tuple[str, list[Mesh]]) -> None:
    for mesh in drawn[1]:
        low, high = mesh.bounds
        assert np.linalg.norm(high - low) == pytest.approx(1.0, abs=1e-4)
        assert np.allclose(low + high, 0.0, atol=1e-4)
        assert FEWEST_FACES <= len(mesh.faces) <= MOST_FACES
        assert np.allclose(np.linalg.norm(mesh.corner_normals, axis=2), 1.0, atol=1e-3)


def test_models_are_coloured(drawn: tuple[str, list[Mesh]]) -> None:
    several = sum(len(mesh.materials) > 1 for mesh in drawn[1])
    assert several >= len(SEEDS) * 0.6
    looks = {(*np.round(mesh.materials[0].rgba, 2), mesh.materials[0].name) for mesh in drawn[1]}
    textured = any(m.texture is not None for mesh in drawn[1] for m in mesh.materials)
    assert len(looks) > 3 or textured


def test_a_seed_says_all(drawn: tuple[str, list[Mesh]]) -> None:
    category, meshes = drawn
    again = make(category, 3)
    for name in ("vertices", "faces", "corner_normals", "corner_uv", "face_material"):
        assert np.array_equal(getattr(again, name), getattr(meshes[3], name))
    for one, other in zip(again.materials, meshes[3].materials, strict=True):
        assert one.rgba == other.rgba
        assert one.texture is other.texture is None or np.array_equal(one.texture, other.texture)  # type: ignore[arg-type]
    for last, this in pairwise(meshes):
        assert last.vertices.shape != this.vertices.shape or not np.allclose(last.vertices, this.vertices)


def _behind(mesh: Mesh) -> float:
    """Mean z of the surface in the upper third, less that of the whole; by area."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    middle = corners.mean(axis=1)
    low, high = mesh.bounds[:, 1]
    upper = middle[:, 1] > low + 0.72 * (high - low)
    return float(np.average(middle[upper, 2], weights=area[upper]) - np.average(middle[:, 2], weights=area))


@pytest.mark.parametrize("category", sorted(HIGH_BEHIND & set(GENERATORS)))
def test_the_back_is_behind(category: str) -> None:
    behind = np.array([_behind(make(category, seed)) for seed in range(30)])
    # A canopy bed's top lies over all of it; every other model has its back at +z.
    assert (behind > 0).mean() > 0.9
    assert behind.mean() > 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_of_chair_looks_to_the_front(kind: str) -> None:
    for seed in range(4):
        assert _behind(KINDS[kind][1](np.random.default_rng(seed)).mesh(kind)) > 0


def _front_facing_detail(mesh: Mesh) -> int:
    """Faces in the front slice less those in the back slice: doors and drawers have more than a bare back."""
    z = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    low, high = mesh.bounds[:, 2]
    band = 0.25 * (high - low)
    return int((z < low + band).sum() - (z > high - band).sum())


@pytest.mark.parametrize("category", ["cabinet"])
def test_doors_and_drawers_are_at_the_front(category: str) -> None:
    detail = [_front_facing_detail(make(category, seed)) for seed in range(20)]
    assert np.mean(np.array(detail) > 0) >= 0.9


def test_an_unknown_category_is_told() -> None:
    with pytest.raises(InputError, match="no parametric model of category 'unicorn'"):
        make("unicorn", 0)
