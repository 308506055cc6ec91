from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Material, Mesh
from cadpose.library.sampling import sample_faces, sample_surface
from cadpose.library.symmetry import (
    VERSION,
    category_symmetry,
    kept_symmetry,
    mesh_symmetry,
    surface_colours,
)
from tests.geometry.symmetry_shapes import box, moved, prism, turned

WHITE = Material((0.9, 0.9, 0.9, 1.0))


def mesh_of(*parts: tuple[FloatArray, Material]) -> Mesh:
    """Triangles with flat normals that point away from the middle of their part."""
    triangles = np.concatenate([t for t, _ in parts])
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    triangles = triangles[np.linalg.norm(area, axis=1) > 1e-9]
    number = np.concatenate([np.full(len(t), i) for i, (t, _) in enumerate(parts)])
    number = number[np.linalg.norm(area, axis=1) > 1e-9]
    normals = []
    for i in range(len(parts)):
        own = triangles[number == i]
        n = np.cross(own[:, 1] - own[:, 0], own[:, 2] - own[:, 0])
        n /= np.linalg.norm(n, axis=1, keepdims=True)
        outward = np.sign(((own.mean(axis=1) - own.mean(axis=(0, 1))) * n).sum(axis=1))
        normals.append(n * outward[:, None])
    corner_normals = np.repeat(np.concatenate(normals)[:, None], 3, axis=1)
    return Mesh(
        triangles.reshape(-1, 3).astype(np.float32),
        np.arange(len(triangles) * 3, dtype=np.int32).reshape(-1, 3),
        corner_normals.astype(np.float32),
        np.zeros((len(triangles), 3, 2), np.float32),
        number.astype(np.int32),
        tuple(m for _, m in parts),
    )


def legs(width: float, depth: float) -> FloatArray:
    return np.concatenate(
        [
            moved(box(0.06, 0.7, 0.06), sx * width / 2, -0.35, sz * depth / 2)
            for sx in (-1, 1)
            for sz in (-1, 1)
        ]
    )


def test_furniture() -> None:
    square = mesh_of((box(1, 0.05, 1), WHITE), (legs(0.8, 0.8), WHITE))
    assert mesh_symmetry(square).name == "C4"
    assert mesh_symmetry(mesh_of((box(1.4, 0.05, 0.8), WHITE), (legs(1.2, 0.6), WHITE))).name == "C2"
    pedestal = turned(
        np.array([[0, -0.7], [0.3, -0.7], [0.05, -0.6], [0.05, 0], [0.6, 0], [0.6, 0.04], [0, 0.04]]), 32
    )
    assert mesh_symmetry(mesh_of((pedestal, WHITE))).name == "revolution"
    chair = mesh_of(
        (box(0.5, 0.05, 0.5), WHITE),
        (legs(0.4, 0.4), WHITE),
        (moved(box(0.5, 0.5, 0.05), 0, 0.3, 0.22), WHITE),
    )
    assert mesh_symmetry(chair).is_trivial
    wardrobe = box(1.0, 2.0, 0.6)
    assert mesh_symmetry(mesh_of((wardrobe, WHITE))).name == "D2"
    knobs = np.concatenate([moved(box(0.05, 0.3, 0.1), x, 0.3, -0.35) for x in (-0.1, 0.1)])
    assert mesh_symmetry(mesh_of((wardrobe, WHITE), (knobs, WHITE))).is_trivial


def test_a_red_side_counts_and_what_is_hidden_does_not() -> None:
    red = Material((0.8, 0.1, 0.1, 1.0))
    body = box(0.8, 1.0, 0.8)
    inside = moved(box(0.2, 0.5, 0.1), 0.1, 0.1, 0.2)
    assert mesh_symmetry(mesh_of((body, WHITE), (inside, red))).name == "D4"
    assert mesh_symmetry(mesh_of((body[:10], WHITE), (body[10:], red))).about().is_trivial
    # The same in a window shows.
    glass = Material((0.9, 0.9, 0.9, 0.3))
    assert mesh_symmetry(mesh_of((body, glass), (inside, red))).about().is_trivial


def test_normals_turned_inwards_are_forgiven() -> None:
    good = mesh_of((prism(6, 0.5, 0.8), WHITE))
    bad = Mesh(good.vertices, good.faces, -good.corner_normals, good.corner_uv, good.face_material)
    assert mesh_symmetry(bad).name == "D6"


def textured(image: NDArray[np.uint8], rgba: tuple[float, float, float, float] = (1, 1, 1, 1)) -> Mesh:
    return Mesh(
        np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.tile(np.array([0, 0, 1], np.float32), (2, 3, 1)),
        np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float32),
        np.zeros(2, np.int32),
        (Material(rgba, image),),
    )


def test_colours_are_the_texture_times_the_material() -> None:
    image = np.zeros((2, 2, 4), np.uint8)
    image[0, 0], image[0, 1], image[1, 0], image[1, 1] = (
        (255, 0, 0, 255),
        (0, 255, 0, 255),
        (0, 0, 255, 255),
        51,
    )
    mesh = textured(image, (1.0, 0.5, 1.0, 1.0))
    points, face, weights = sample_faces(mesh, 500)
    colour, alpha = surface_colours(mesh, face, weights)
    left, top = points[:, 0] < 0.5, points[:, 1] > 0.5
    assert np.allclose(colour[left & top], [1, 0, 0])
    assert np.allclose(colour[~left & top], [0, 0.5, 0])
    assert np.allclose(colour[left & ~top], [0, 0, 1])
    assert np.allclose(alpha[~left & ~top], 0.2)
    assert np.array_equal(points, sample_surface(mesh, 500))
    corners = mesh.vertices[mesh.faces[face]]
    assert np.allclose(np.einsum("nk,nkc->nc", weights, corners), points, atol=1e-6)


def test_grain_is_averaged_away() -> None:
    rng = np.random.default_rng(0)
    grain = textured(rng.integers(0, 2, (200, 200, 1), np.uint8) * np.full(3, 255, np.uint8))
    _, face, weights = sample_faces(grain, 500)
    sharp, _ = surface_colours(grain, face, weights)
    smooth, _ = surface_colours(grain, face, weights, detail=0.1)
    assert sharp.std() > 0.4
    assert smooth.std() < 0.05
    assert smooth.mean() == pytest.approx(0.5, abs=0.03)


@pytest.mark.parametrize(
    ("category", "name"),
    [
        ("bottle", "revolution"),
        ("bowl", "revolution"),
        ("ball", "sphere"),
        ("car", "trivial"),
        ("?", "trivial"),
    ],
)
def test_categories(category: str, name: str) -> None:
    assert category_symmetry(category).name == name


def test_kept_beside_the_mesh(tmp_path: Path) -> None:
    made = mesh_of((box(1, 2, 1), WHITE))
    asked = []

    def mesh() -> Mesh:
        asked.append(1)
        return made

    where = tmp_path / "ab" / "abc.npz"
    first = kept_symmetry(where, mesh)
    again = kept_symmetry(where, mesh)
    assert first.name == again.name == "D4"
    assert np.array_equal(first.rotations, again.rotations)
    assert len(asked) == 1
    kept = where.with_suffix(f".symmetry{VERSION}.json")
    # A damaged file, or one that is far too large, is worked out anew and mended.
    for wrong in (b"{", b"[1]", b'{"every": true}', b" " * 10**6):
        kept.write_bytes(wrong)
        assert kept_symmetry(where, mesh).name == "D4"
        assert SymmetryGroup.from_json(json.loads(kept.read_bytes())).name == "D4"
    assert len(asked) == 5


def test_of_a_library(tmp_path: Path) -> None:
    obj = "".join(f"v {x} {y} {z}\n" for x in (0, 3) for y in (0, 2) for z in (0, 1))
    obj += "".join(
        f"f {a} {b} {c} {d}\n"
        for a, b, c, d in ((1, 2, 4, 3), (5, 7, 8, 6), (1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4))
    )
    folder = tmp_path / "boxes" / "chair"
    folder.mkdir(parents=True)
    (folder / "long.obj").write_text(obj)
    from cadpose.library.importers import add_path

    library = Library.create(tmp_path / "library")
    add_path(library, tmp_path / "boxes")
    (model,) = library.models()
    assert library.symmetry(model).name == "D2"
    assert library.symmetry(model.id).about().name == "C2"
    assert library.check() == []
    assert len(list((tmp_path / "library").rglob("*.symmetry*.json"))) == 1
    library.remove([model.id])
    assert list((tmp_path / "library").rglob("*.symmetry*.json")) == []
