"""A CAD model alone as a .glb, as the review page draws it."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.annotations.scenes.glb import read_header
from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.library.loading import load_mesh_file
from cadpose.library.mesh import Mesh
from cadpose.rendering.raster import Rasteriser
from tests.review.web_numbers import square

CAMERAS = Cameras.from_rotations(
    rotation_from_angles([20.0, 200.0], [15.0, -25.0], [5.0, 120.0]), focal_px=400.0, width=260, height=200
)


def header_of(data: bytes) -> dict[str, Any]:
    return read_header(io.BytesIO(data), len(data))


def checks(holes: bool) -> Mesh:
    """A square with a pattern, which may have holes."""
    y, x = np.mgrid[:64, :64] // 16
    odd = (x + y) % 2 == 1
    rgb = np.where(odd[..., None], (220, 60, 40), (40, 90, 200)).astype(np.uint8)
    return square(np.dstack([rgb, np.where(odd, 255, 0).astype(np.uint8)]) if holes else rgb, 1.0)


def assert_looks_alike(mesh: Mesh, again: Mesh) -> None:
    before, after = (Rasteriser().render(m, CAMERAS) for m in (mesh, again))
    np.testing.assert_array_equal(before.alpha, after.alpha)
    # Faces come in another order, which decides between those that touch.
    differ = np.abs(before.rgb.astype(int) - after.rgb).max(axis=3) > 4
    assert differ.sum() < 0.005 * before.mask.sum()


@pytest.mark.parametrize("name", ["made/car/hatch.obj", "made/chair/throne.glb"])
def test_a_model_comes_back_as_it_was(small_library: Library, tmp_path: Path, name: str) -> None:
    mesh = small_library.mesh(name)
    (tmp_path / "model.glb").write_bytes(single_mesh_glb(mesh))
    again = load_mesh_file(tmp_path / "model.glb")
    # In its own axes, diagonal 1.
    np.testing.assert_allclose(again.bounds, mesh.bounds, atol=1e-6)
    assert np.linalg.norm(np.ptp(again.bounds, axis=0)) == pytest.approx(1.0, abs=1e-5)
    assert_looks_alike(mesh, again)


@pytest.mark.parametrize("holes", [False, True])
def test_textures_come_back(tmp_path: Path, holes: bool) -> None:
    data = single_mesh_glb(checks(holes))
    (tmp_path / "model.glb").write_bytes(data)
    header = header_of(data)
    assert header["materials"][0]["alphaMode"] == ("MASK" if holes else "OPAQUE")
    assert len(header["images"]) == 1
    assert_looks_alike(checks(holes), load_mesh_file(tmp_path / "model.glb"))


def test_it_is_one_mesh_and_the_same_bytes_each_time(small_library: Library) -> None:
    mesh = small_library.mesh("made/car/hatch.obj")
    data = single_mesh_glb(mesh, "hatch")
    assert data == single_mesh_glb(mesh, "hatch")
    header = header_of(data)
    assert [one["name"] for one in header["meshes"]] == ["hatch"]
    assert len(header["meshes"][0]["primitives"]) == len(header["materials"])
    assert header["nodes"] == [{"name": "hatch", "mesh": 0}]


def test_glass_is_told_and_what_is_invisible_left_out() -> None:
    assert header_of(single_mesh_glb(square(None, 0.3)))["materials"][0]["alphaMode"] == "BLEND"
    assert "meshes" not in header_of(single_mesh_glb(square(None, 0.0)))
