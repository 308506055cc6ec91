from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Material, Mesh
from cadpose.library.normals import crease_normals
from cadpose.rendering.raster import Rasteriser
from cadpose.training.simplify import simplified, simplify_library

pytest.importorskip("fast_simplification", reason="needs cadpose[train]")
pytest.importorskip("scipy")


def mesh_of(shapes: list[Any], side: int = 64) -> Mesh:
    """Shapes with a material each; the first has a texture. Unit diagonal, centred."""
    whole: Any = trimesh.util.concatenate(shapes)
    vertices = np.asarray(whole.vertices) - whole.bounds.mean(axis=0)
    vertices /= np.linalg.norm(whole.extents)
    faces = np.asarray(whole.faces, np.int64)
    uv = vertices[faces][..., :2].astype(np.float32)
    texture = np.full((side, side // 2, 3), 200, np.uint8)
    return Mesh(
        vertices=vertices.astype(np.float32),
        faces=faces.astype(np.int32),
        corner_normals=crease_normals(vertices, faces),
        corner_uv=uv,
        face_material=np.repeat(np.arange(len(shapes)), [len(s.faces) for s in shapes]).astype(np.int32),
        materials=tuple(
            Material((1.0, 0.2 * i, 0.0, 1.0), texture if i == 0 else None) for i in range(len(shapes))
        ),
    )


@pytest.fixture(scope="module")
def smooth() -> Mesh:
    """A ring around a ball, 9000 faces of which few are needed."""
    ring = trimesh.creation.torus(0.8, 0.2, major_sections=80, minor_sections=24)
    return mesh_of([trimesh.creation.icosphere(subdivisions=4, radius=0.4), ring])


def iou(a: Mesh, b: Mesh) -> list[float]:
    R = rotation_from_angles([0.0, 50.0, 130.0], [10.0, 60.0, -30.0], [0.0, 20.0, 0.0])
    cameras = Cameras.from_rotations(R, focal_px=300.0, width=200, height=200)
    one, two = (Rasteriser().render(mesh, cameras).mask for mesh in (a, b))
    return [float((x & y).sum() / (x | y).sum()) for x, y in zip(one, two, strict=True)]


def test_fewer_faces_look_the_same(smooth: Mesh) -> None:
    small = simplified(smooth, faces=1500, texture_side=16)
    assert len(smooth.faces) > 8000 and len(small.faces) <= 1800
    assert min(iou(smooth, small)) > 0.97
    assert [m.texture is None for m in small.materials] == [False, True]
    assert small.materials[0].texture is not None and small.materials[0].texture.shape == (16, 8, 3)
    # The ball stays in the middle and keeps its material.
    radius = np.linalg.norm(small.vertices[small.faces].mean(axis=1), axis=1)
    reach = np.linalg.norm(smooth.vertices[smooth.faces].mean(axis=1), axis=1)
    assert radius[small.face_material == 0].max() < 1.05 * reach[smooth.face_material == 0].max()
    assert set(small.face_material) == {0, 1}
    # Texture coordinates here are x and y: carried over, they still are, where faces are no slivers.
    corners = small.vertices[small.faces][..., :2]
    assert np.percentile(np.abs(small.corner_uv - corners).max(axis=(1, 2)), 90) < 0.01


def test_a_mesh_with_few_faces_is_kept(smooth: Mesh) -> None:
    small = simplified(smooth, faces=10_000, texture_side=16)
    assert np.array_equal(small.faces, smooth.faces) and np.array_equal(small.vertices, smooth.vertices)


def test_a_shape_that_tears_is_kept_whole() -> None:
    """Two hundred loose slats: with eight faces for each pair of them, most would have to go."""
    slats = []
    for i in range(200):
        slat = trimesh.creation.box((0.004, 1.0, 0.004))
        slat.apply_translation((i / 200, 0.0, 0.3 * (i % 7)))
        slats.append(slat)
    fence = mesh_of([trimesh.util.concatenate(slats)])
    small = simplified(fence, faces=50)
    assert np.array_equal(small.faces, fence.faces)
    assert min(iou(fence, small)) == 1.0


def test_a_library_of_simplified_copies(small_library: Library, tmp_path: Path) -> None:
    ids = [m.id for m in small_library.models()]
    done: list[str] = []
    before = small_library.check()
    copies = simplify_library(
        small_library, tmp_path / "copies", ids[1:], {"": 10_000, "chair": 60}, 16, on_done=done.append
    )
    assert done == ids[1:] == [m.id for m in copies.models()]
    assert copies.check() == [] and small_library.check() == before == []
    for model in copies.models():
        old = small_library.get(model.id)
        assert (model.category, model.licence, model.name) == (old.category, old.licence, old.name)
        assert model.face_count == len(copies.mesh(model).faces) <= old.face_count
        assert min(iou(small_library.mesh(old), copies.mesh(model))) > 0.97
