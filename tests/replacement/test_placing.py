"""Where the new model stands."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.errors import InputError
from cadpose.geometry.camera import projected_rectangle
from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import CadModel
from cadpose.replacement.placing import standing_pose
from tests.rendering.shapes import cube, mesh_of

OLD = CadModel("old", "Old", "thing", size_cm=(100.0, 100.0, 100.0))


def block(width: float, height: float, depth: float) -> Mesh:
    """A box of unit diagonal and these proportions."""
    size = np.array([width, height, depth])
    size /= np.linalg.norm(size)
    unit_cube = cube(1.0)
    return mesh_of(unit_cube.vertices[unit_cube.faces] * size)


def rectangle(mesh: Mesh, pose: Pose4Dof) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    told = projected_rectangle(pose.rotation.to_matrix(), mesh.hull, t_z=pose.t_z)[0] * pose.focal_px
    return np.asarray(told + np.tile(pose.principal_px, 2))


@given(
    st.floats(0, 359),
    st.floats(1, 50),
    st.floats(0.2, 3.0),
    st.floats(0.2, 3.0),
)
def test_it_stands_where_the_old_one_stood(
    azimuth: float, elevation: float, width: float, height: float
) -> None:
    pose = Pose4Dof(Rotation(azimuth, elevation), 400.0, (200.0, 150.0))
    old, new = block(1.0, 1.0, 1.0), block(width, height, 1.0)
    placed = standing_pose(old, OLD, new, CadModel("new", "New", "thing"), pose)
    assert placed.rotation == pose.rotation and placed.t_z == pose.t_z
    before, after = rectangle(old, pose), rectangle(new, placed)
    assert after[3] == pytest.approx(before[3], abs=1e-6)
    wider, higher = (after[2:] - after[:2]) / (before[2:] - before[:2])
    assert max(wider, higher) < 1.5
    assert placed.focal_px > 0


def test_the_same_model_stays_where_it_is() -> None:
    pose = Pose4Dof(Rotation(30.0, 10.0), 400.0, (200.0, 150.0))
    placed = standing_pose(cube(), OLD, cube(), OLD, pose)
    assert placed.focal_px == pytest.approx(400.0)
    assert placed.principal_px == pytest.approx((200.0, 150.0))


def test_real_sizes_are_kept() -> None:
    pose = Pose4Dof(Rotation(30.0, 1.0), 400.0, (200.0, 150.0))
    new = CadModel("new", "New", "thing", size_cm=(50.0, 50.0, 50.0))
    placed = standing_pose(cube(), OLD, cube(), new, pose, "real")
    x0, _, x1, _ = rectangle(cube(), pose)
    a0, _, a1, _ = rectangle(cube(), placed)
    assert (a1 - a0) / (x1 - x0) == pytest.approx(0.5, rel=0.02)


def test_an_unknown_size_is_told() -> None:
    pose = Pose4Dof(Rotation(30.0, 10.0), 400.0, (200.0, 150.0))
    with pytest.raises(InputError, match=r"the size of New is unknown.*--size match"):
        standing_pose(cube(), OLD, cube(), CadModel("new", "New", "thing"), pose, "real")
