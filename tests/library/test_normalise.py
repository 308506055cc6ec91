from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from cadpose.errors import InputError
from cadpose.library.loading import load_mesh
from cadpose.library.normalise import AXES, normalise, rotation_from_axes

from .builders import NoAssets, obj_box


@given(
    st.tuples(*[st.floats(0.01, 1000.0)] * 3),
    st.tuples(*[st.floats(-1.0, 1.0)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
)
def test_normalised_box(size: tuple[float, float, float], quaternion: tuple[float, ...]) -> None:
    mesh = load_mesh(obj_box(*size).encode(), "b.obj", NoAssets())
    R = Rotation.from_quat(quaternion).as_matrix()
    turned, scale = normalise(mesh, R)
    low, high = turned.bounds
    assert np.linalg.norm(high - low) == pytest.approx(1.0, abs=1e-5)
    assert np.abs(low + high).max() < 1e-6
    # Shape is kept: distances are the file's, times the scale.
    before = np.linalg.norm(np.diff(mesh.vertices.astype(float), axis=0), axis=1)
    after = np.linalg.norm(np.diff(turned.vertices.astype(float), axis=0), axis=1)
    assert after == pytest.approx(before * scale, rel=1e-3, abs=1e-5)
    assert np.linalg.norm(turned.corner_normals, axis=2) == pytest.approx(1.0, abs=1e-5)


@pytest.mark.parametrize("front", sorted(AXES))
@pytest.mark.parametrize("up", sorted(AXES))
def test_axes(front: str, up: str) -> None:
    if front[1] == up[1]:
        with pytest.raises(InputError, match="perpendicular"):
            rotation_from_axes(front, up)
        return
    R = rotation_from_axes(front, up)
    assert np.linalg.det(R) == pytest.approx(1.0)
    assert (R @ AXES[front]).tolist() == [0, 0, -1]
    assert (R @ AXES[up]).tolist() == [0, 1, 0]


def test_axes_by_name() -> None:
    assert np.array_equal(rotation_from_axes("Z", " y "), rotation_from_axes("+z", "+y"))
    with pytest.raises(InputError, match="not an axis"):
        rotation_from_axes("forward", "y")


def test_a_matrix_that_is_no_rotation_is_refused() -> None:
    mesh = load_mesh(obj_box(1, 2, 3).encode(), "b.obj", NoAssets())
    with pytest.raises(InputError, match="rotation"):
        normalise(mesh, np.diag([1.0, 2.0, 1.0]))
