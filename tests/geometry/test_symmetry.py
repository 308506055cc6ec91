from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry import SymmetryGroup, find_symmetry, rotation_about
from tests.geometry.symmetry_shapes import ball, box, icosahedron, moved, prism, pyramid, sample, turned

BOTTLE = turned(np.array([[0, -1], [0.4, -1], [0.4, 0.4], [0.12, 0.7], [0.12, 1], [0, 1.0]]), 40)
L_SHAPE = np.concatenate([box(2, 0.4, 1), moved(box(0.4, 1.6, 1), -0.8, 0.8, 0)])
# The seat, four legs and a back: the legs alone would look alike from four sides.
CHAIR = np.concatenate(
    [box(1, 0.1, 1), moved(box(1, 1, 0.1), 0, 0.5, 0.45)]
    + [moved(box(0.1, 0.9, 0.1), x, -0.5, z) for x in (-0.45, 0.45) for z in (-0.45, 0.45)]
)
KNOWN: dict[str, tuple[FloatArray, SymmetryGroup]] = {
    "box": (box(3, 2, 1), SymmetryGroup.dihedral(2)),
    "cube": (box(1, 1, 1), SymmetryGroup.generated_by([rotation_about(np.eye(3)[i], 90.0) for i in (0, 1)])),
    "square prism": (box(1, 2, 1), SymmetryGroup.dihedral(4)),
    "cylinder": (prism(48, 0.5, 2.0), SymmetryGroup.revolution(two_sided=True)),
    "cone": (pyramid(48), SymmetryGroup.revolution()),
    "bottle": (BOTTLE, SymmetryGroup.revolution()),
    "ball": (ball(), SymmetryGroup.sphere()),
    "L": (L_SHAPE, SymmetryGroup.trivial()),
    "chair": (CHAIR, SymmetryGroup.trivial()),
    "icosahedron": (
        icosahedron(),
        SymmetryGroup.generated_by(
            [rotation_about((0, 1, 1.618034), 72.0), rotation_about((1, 1, 1), 120.0)]
        ),
    ),
    **{f"prism {n}": (prism(n, 1.0, 1.2), SymmetryGroup.dihedral(n)) for n in (3, 5, 6, 7)},
    **{f"pyramid {n}": (pyramid(n), SymmetryGroup.cyclic(n)) for n in (3, 4, 5, 6)},
}


def check(triangles: FloatArray, known: SymmetryGroup, R: FloatArray, seed: int, count: int = 3000) -> None:
    points, _ = sample(triangles, count, seed)
    rng = np.random.default_rng(seed)
    found = find_symmetry((points + rng.normal(0.0, 0.006, points.shape)) @ R.T)
    assert found.name == known.name
    if known.every:
        return
    if known.axis is not None:
        assert found.axis is not None
        assert abs(found.axis @ R @ known.axis) > np.cos(np.deg2rad(3.0))
        return
    # In the turned object's axes its rotations are R S R^T; each was found within a few degrees.
    turned_group = R @ known.rotations @ R.T
    assert geodesic_degrees(turned_group[:, None], found.rotations).min(axis=1).max() < 4.0


@pytest.mark.parametrize("name", KNOWN)
def test_known_shapes_upright(name: str) -> None:
    check(*KNOWN[name], np.eye(3), seed=1)


@settings(max_examples=8, derandomize=True, deadline=None)
@given(
    st.sampled_from(sorted(KNOWN)),
    st.tuples(st.floats(0, 360), st.floats(-90, 90), st.floats(-180, 180)),
    st.integers(0, 1000),
)
def test_known_shapes_however_turned(name: str, angles: tuple[float, float, float], seed: int) -> None:
    check(*KNOWN[name], rotation_from_angles(*angles), seed)


def test_axes_of_the_object_are_exact() -> None:
    points, _ = sample(box(1, 2, 1), 3000, 0)
    found = find_symmetry(points)
    assert geodesic_degrees(found.rotations, rotation_about((0, 1, 0), 90.0)).min() < 0.5
    cone = find_symmetry(sample(pyramid(48), 3000, 0)[0])
    assert cone.axis is not None
    assert np.array_equal(np.abs(cone.axis), [0, 1, 0])


def test_colour_breaks_symmetry() -> None:
    points, triangle = sample(box(1, 1, 1), 6000, 0)
    side = triangle // 2
    white = np.ones((6000, 3))
    assert find_symmetry(points, colours=white).order == 24
    # One red side, +y: what turns about y is left. Two opposite ones: the whole square prism's group.
    one = np.where((side == 3)[:, None], [0.9, 0.1, 0.1], white)
    assert find_symmetry(points, colours=one).name == "C4"
    two = np.where(((side == 3) | (side == 2))[:, None], [0.9, 0.1, 0.1], white)
    assert find_symmetry(points, colours=two).name == "D4"
    # The colours count, not their order: the other side red, the axis the same.
    assert find_symmetry(points, colours=1.0 - one).name == "C4"


def test_noisy_colours_are_no_pattern() -> None:
    points, _ = sample(box(3, 2, 1), 4000, 0)
    rng = np.random.default_rng(0)
    grain = np.clip(0.5 + rng.normal(0.0, 0.06, (4000, 1)) + np.zeros(3), 0, 1)
    assert find_symmetry(points, colours=grain).name == "D2"


def test_a_handle_is_seen_among_many_points() -> None:
    fridge = box(0.6, 1.8, 0.6)
    handle = moved(box(0.04, 0.6, 0.06), -0.25, 0.2, -0.33)
    both = np.concatenate([fridge, handle])
    points, triangle = sample(both, 20_000, 0)
    assert find_symmetry(points).is_trivial
    # A flat one of another colour shows by its colour alone.
    flat = moved(box(0.08, 0.5, 0.001), -0.2, 0.2, -0.3005)
    points, triangle = sample(np.concatenate([fridge, flat]), 20_000, 0)
    steel = np.where((triangle >= 12)[:, None], 0.2, 0.9) + np.zeros(3)
    assert find_symmetry(points).name == "D4"
    assert find_symmetry(points, colours=steel).is_trivial


def test_normals_tell_the_faces_of_a_sheet_apart() -> None:
    picture = box(1.0, 0.7, 0.004)
    points, triangle = sample(picture, 20_000, 0)
    normals = np.zeros((20_000, 3))
    side = triangle // 2
    normals[np.arange(20_000), side // 2] = np.where(side % 2, 1.0, -1.0)
    white = np.ones((20_000, 3))
    painted = np.where((side == 4)[:, None], [0.8, 0.3, 0.1], [0.9, 0.9, 0.9])
    assert find_symmetry(points, normals, white).name == "D2"
    assert find_symmetry(points, colours=painted).name == "D2"
    # About z it stays what it was; about y its back would come to the front.
    assert find_symmetry(points, normals, painted).about().is_trivial
    assert find_symmetry(points, normals, painted).about((0, 0, 1)).name == "C2"


def test_what_is_not_tested_need_not_meet_anything() -> None:
    points, triangle = sample(
        np.concatenate([box(1, 2, 1), moved(box(0.2, 0.4, 0.1), 0.1, 0.3, 0.2)]), 8000, 0
    )
    assert find_symmetry(points).is_trivial
    assert find_symmetry(points, tested=triangle < 12).name == "D4"
    with pytest.raises(ValueError, match="tested"):
        find_symmetry(points, tested=np.zeros(8000, np.bool_))


def test_scale_and_place_do_not_matter() -> None:
    points, _ = sample(box(3, 2, 1), 3000, 0)
    for scale, shift in ((1e-3, 0.0), (1e4, 1e5)):
        assert find_symmetry(points * scale + shift).name == "D2"


def test_the_same_points_give_the_same_group() -> None:
    points, _ = sample(prism(5), 2000, 0)
    a, b = find_symmetry(points), find_symmetry(points.copy())
    assert np.array_equal(a.rotations, b.rotations)


@pytest.mark.parametrize(
    ("points", "normals", "reason"),
    [
        (np.zeros((100, 2)), None, "arrays"),
        (np.zeros((100, 3)), None, "one"),
        (np.eye(3), None, "at least"),
        (np.full((100, 3), np.nan), None, "finite"),
        (np.random.default_rng(0).random((100, 3)), np.zeros((99, 3)), "length"),
    ],
)
def test_wrong_arguments(points: FloatArray, normals: FloatArray | None, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        find_symmetry(points, normals)
