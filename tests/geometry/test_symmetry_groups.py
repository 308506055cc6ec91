from __future__ import annotations

import json
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup, rotation_about

CUBE = SymmetryGroup.generated_by([rotation_about((1, 0, 0), 90.0), rotation_about((0, 1, 0), 90.0)])
GROUPS = [
    SymmetryGroup.trivial(),
    SymmetryGroup.cyclic(2),
    SymmetryGroup.cyclic(5, (1.0, 2.0, -0.5)),
    SymmetryGroup.dihedral(2),
    SymmetryGroup.dihedral(4, (0.0, 0.0, 3.0), (1.0, 1.0, 1.0)),
    CUBE,
    SymmetryGroup.revolution(),
    SymmetryGroup.revolution((0.3, -2.0, 1.0), two_sided=True),
    SymmetryGroup.sphere(),
]
groups = st.sampled_from(GROUPS)


@st.composite
def rotations(draw: st.DrawFn) -> FloatArray:
    angle = st.floats(-180.0, 180.0)
    return rotation_from_angles(draw(angle), draw(st.floats(-90.0, 90.0)), draw(angle))


@pytest.mark.parametrize(
    ("group", "order", "name"),
    list(
        zip(
            GROUPS,
            (1, 2, 5, 4, 8, 24, math.inf, math.inf, math.inf),
            (
                "trivial",
                "C2",
                "C5",
                "D2",
                "D4",
                "octahedral",
                "revolution",
                "revolution, two-sided",
                "sphere",
            ),
            strict=True,
        )
    ),
    ids=lambda value: value.name if isinstance(value, SymmetryGroup) else str(value),
)
def test_order_and_name(group: SymmetryGroup, order: float, name: str) -> None:
    assert (group.order, group.name, group.is_trivial) == (order, name, order == 1)


@given(groups, rotations(), rotations())
def test_equivalents_have_no_error_and_others_no_more_than_before(
    group: SymmetryGroup, R: FloatArray, other: FloatArray
) -> None:
    same = group.equivalents(R, samples=12)
    assert np.allclose(same[0], R)
    assert group.geodesic_degrees(R, same).max() < 1e-5
    error = group.geodesic_degrees(R, other)
    assert error <= geodesic_degrees(R, other) + 1e-9
    assert group.geodesic_degrees(other, R) == pytest.approx(error, abs=1e-6)
    # Whichever of the equal ones is taken on either side, the error is the same.
    assert np.allclose(group.geodesic_degrees(same, other), error, atol=1e-5)
    assert np.allclose(group.geodesic_degrees(other, same), error, atol=1e-5)
    # Turning the camera turns both.
    assert np.allclose(group.geodesic_degrees(other @ R, other @ other), error, atol=1e-5)


@given(groups, rotations(), rotations(), rotations())
def test_the_triangle_inequality(group: SymmetryGroup, a: FloatArray, b: FloatArray, c: FloatArray) -> None:
    error = group.geodesic_degrees
    assert error(a, c) <= error(a, b) + error(b, c) + 1e-6


@given(groups, rotations(), rotations())
def test_nearest_is_the_best_of_a_fine_list(group: SymmetryGroup, R: FloatArray, to: FloatArray) -> None:
    nearest = group.nearest(R, to)
    error = group.geodesic_degrees(R, to)
    assert geodesic_degrees(nearest, to) == pytest.approx(float(error), abs=1e-5)
    assert group.geodesic_degrees(nearest, R) < 1e-5
    if not group.every:
        listed = geodesic_degrees(group.equivalents(R, samples=720), to).min()
        # The closed form is no worse than the list, which is 0.25 degrees off at most.
        assert error <= listed + 1e-6
        assert listed <= error + 0.26


def test_a_sphere_is_sampled_all_over() -> None:
    some = SymmetryGroup.sphere().equivalents(np.eye(3), samples=30)
    assert some.shape == (900, 3, 3)
    rng = np.random.default_rng(0)
    for azimuth, elevation, inplane in rng.uniform(-180, 180, (50, 3)):
        assert geodesic_degrees(rotation_from_angles(azimuth, elevation / 2, inplane), some).min() < 30.0


def test_many_at_once() -> None:
    a = rotation_from_angles(np.arange(6.0) * 50, 20.0).reshape(2, 3, 3, 3)
    b = rotation_from_angles(10.0, -20.0, 30.0)
    for group in GROUPS:
        error = group.geodesic_degrees(a, b)
        assert error.shape == (2, 3)
        assert error[1, 2] == pytest.approx(float(group.geodesic_degrees(a[1, 2], b)), abs=1e-9)
        assert group.nearest(a, b).shape == (2, 3, 3, 3)
        assert np.allclose(group.nearest(a, b)[1, 0], group.nearest(a[1, 0], b))


def test_a_square_table_by_hand() -> None:
    table, true = SymmetryGroup.cyclic(4), rotation_from_angles(10.0, 30.0)
    for azimuth, error in ((100.0, 0.0), (195.0, 5.0), (265.0, 15.0), (55.0, 45.0)):
        turned = rotation_from_angles(azimuth, 30.0)
        less = table.geodesic_degrees(true, turned)
        # Turning about the vertical is a turn by just as much, whatever the elevation.
        assert less == pytest.approx(error, abs=1e-6)
    assert table.geodesic_degrees(true, rotation_from_angles(10.0, 50.0)) == pytest.approx(20.0)


def test_a_bottle_has_no_azimuth_but_an_elevation() -> None:
    bottle, true = SymmetryGroup.revolution(), rotation_from_angles(10.0, 30.0)
    assert bottle.geodesic_degrees(true, rotation_from_angles(123.0, 42.0)) == pytest.approx(12.0)
    # Upside down is another picture, but for a plain rod.
    down = rotation_from_angles(10.0, -30.0, 180.0)
    assert bottle.geodesic_degrees(true, down) > 100.0
    assert SymmetryGroup.revolution(two_sided=True).geodesic_degrees(true, down) == pytest.approx(
        0.0, abs=1e-5
    )


def test_what_is_left_upright() -> None:
    names = [g.about().name for g in GROUPS]
    slanted = GROUPS[7].about()
    assert names[:2] == ["trivial", "C2"]
    assert (names[3], names[5], names[6], names[8]) == ("C2", "C4", "revolution", "revolution")
    assert GROUPS[2].about().is_trivial
    assert slanted.is_trivial
    lying = SymmetryGroup.revolution((1, 0, 0), two_sided=True)
    assert lying.about().name == "C2"
    assert SymmetryGroup.revolution((1, 0, 0)).about().is_trivial


def test_measured_rotations_make_an_exact_group() -> None:
    rough = [rotation_about((1, 0.03, 0), 91.0), rotation_about((0.03, 1, 0.02), 89.0)]
    group = SymmetryGroup.generated_by(rough)
    assert len(group.rotations) == 24
    # The exact octahedral group, turned by about as much as the measurements were off.
    turn = geodesic_degrees(group.rotations[:, None], CUBE.rotations).min(axis=1)
    assert turn.max() < 8.0
    with pytest.raises(ValueError, match="more than 60"):
        SymmetryGroup.generated_by([rotation_about((0, 1, 0), 72.0), rotation_about((1, 0, 0), 72.0)])


@pytest.mark.parametrize("group", GROUPS, ids=lambda g: g.name)
def test_json_there_and_back(group: SymmetryGroup) -> None:
    again = SymmetryGroup.from_json(json.loads(json.dumps(group.to_json())))
    assert np.array_equal(again.rotations, group.rotations)
    assert (again.axis is None) == (group.axis is None)
    assert again.name == group.name


@pytest.mark.parametrize(
    "data",
    [
        None,
        [],
        {},
        {"every": False},
        {"rotations": "all", "every": False},
        {"rotations": [[1, 2], [3]], "every": False},
        {"rotations": np.eye(3)[None].tolist(), "every": "no"},
        {"rotations": np.eye(3)[None].tolist(), "every": True, "axis": [0, 1, 0]},
        {"rotations": np.eye(3)[None].tolist(), "every": False, "axis": [0, 2, 0]},
        {"rotations": np.eye(3)[None].tolist(), "every": False, "axis": {}},
        {"rotations": [[[float("nan")] * 3] * 3], "every": False},
        {"rotations": [[[10**400] * 3] * 3], "every": False},
    ],
)
def test_other_json_is_refused(data: object) -> None:
    with pytest.raises(ValueError):
        SymmetryGroup.from_json(data)


@pytest.mark.parametrize(
    ("rotations", "axis", "reason"),
    [
        (np.eye(3), None, "shape"),
        (rotation_about((0, 1, 0), [90.0]), None, "identity"),
        (np.stack([np.eye(3), np.diag([-1.0, 1, 1])]), None, "proper"),
        (rotation_about((0, 1, 0), [0.0, 90.0]), None, "product"),
        (rotation_about((0, 1, 0), [0.0, 180.0, 180.0]), None, "twice"),
        (rotation_about((0, 1, 0), [0.0, 180.0]), (0.0, 1.0, 0.0), "half turn"),
        (np.eye(3)[None], (0.0, 1.1, 0.0), "unit"),
    ],
)
def test_no_group_is_refused(rotations: FloatArray, axis: tuple[float, ...] | None, reason: str) -> None:
    with pytest.raises(ValueError, match=reason):
        SymmetryGroup(rotations, None if axis is None else np.array(axis))


def test_arguments_out_of_range() -> None:
    for make in (
        lambda: SymmetryGroup.cyclic(0),
        lambda: SymmetryGroup.cyclic(3, (0, 0, 0)),
        lambda: SymmetryGroup.dihedral(3, (0, 1, 0), (0, 2, 0)),
        lambda: SymmetryGroup.revolution((np.nan, 1, 0)),
        lambda: SymmetryGroup.cyclic(3).equivalents(np.eye(3), samples=0),
    ):
        with pytest.raises(ValueError):
            make()
