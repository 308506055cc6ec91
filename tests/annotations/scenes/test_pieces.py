from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cadpose.annotations.scenes.pieces import Piece, pieces_of
from cadpose.library.mesh import Material
from cadpose.rendering.scene import MaterialKind
from tests.annotations.scenes.made import MATERIALS, block


def by_name() -> dict[str, Piece]:
    return {piece.material.name: piece for piece in pieces_of(block())}


def test_a_piece_a_material_that_is_seen() -> None:
    pieces = by_name()
    assert {name: piece.kind for name, piece in pieces.items()} == {
        "painted": MaterialKind.OPAQUE,
        "plain": MaterialKind.OPAQUE,
        "glass": MaterialKind.GLASS,
        "lattice": MaterialKind.CUTOUT,
    }
    assert len(pieces["painted"].faces) == 4
    assert pieces["plain"].uv is None
    assert pieces["painted"].material.texture is MATERIALS[0].texture


def test_the_corners_are_those_of_the_mesh() -> None:
    mesh = block()
    for piece in pieces_of(mesh):
        number = mesh.materials.index(next(m for m in mesh.materials if m.name == piece.material.name))
        mine = mesh.face_material == number
        assert (piece.vertices[piece.faces] == mesh.vertices[mesh.faces[mine]]).all()
        assert piece.normals[piece.faces] == pytest.approx(mesh.corner_normals[mine])
        if piece.uv is not None:
            assert (piece.uv[piece.faces] == mesh.corner_uv[mine]).all()
        # Two triangles of a side share an edge.
        assert len(piece.vertices) == 2 * len(piece.faces)


def test_normals_have_unit_length_and_agree_with_the_winding() -> None:
    mesh = block()
    normals = mesh.corner_normals.copy() * np.float32(0.97)
    normals[0] *= -1
    normals[1] = 0
    for piece in pieces_of(replace(mesh, corner_normals=normals)):
        assert np.linalg.norm(piece.normals, axis=1) == pytest.approx(1.0)
        if piece.material.name == "plain":
            a, b, c = (piece.vertices[piece.faces[:, i]] for i in range(3))
            assert (np.einsum("fi,fi->f", np.cross(b - a, c - a), piece.normals[piece.faces[:, 0]]) > 0).all()


def test_textured_faces_without_coordinates_show_the_mean_colour() -> None:
    mesh = block()
    uv = mesh.corner_uv.copy()
    uv[mesh.face_material == 0] = 0
    found = {piece.material.name: piece for piece in pieces_of(replace(mesh, corner_uv=uv))}
    assert "painted" not in found
    mean = found["painted (mean)"]
    texture = MATERIALS[0].texture
    assert texture is not None
    assert mean.material.rgba == pytest.approx((*(texture.reshape(-1, 3).mean(axis=0) / 255), 1.0))
    assert mean.uv is None


def test_nothing_seen_gives_no_piece() -> None:
    mesh = replace(block((0,) * 6), materials=(Material((1, 1, 1, 0.0)),))
    assert pieces_of(mesh) == []
