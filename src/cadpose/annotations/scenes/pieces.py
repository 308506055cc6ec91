"""A mesh cut into pieces of one material, each with indexed vertices as glTF and USD want them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.library.mesh import Material, Mesh
from cadpose.library.textures import mean_colour
from cadpose.rendering.scene import MaterialKind, agreeing_normals, material_kind


@dataclass(frozen=True, eq=False)
class Piece:
    """The faces of one material.

    Attributes:
        vertices: (V, 3) float32.
        normals: (V, 3) float32 of unit length, on the side that the winding faces.
        uv: (V, 2) float32, (0, 0) bottom left; None without a texture.
        faces: (F, 3) uint32 indices into the three.
        material: The material; without a texture where ``uv`` is None.
        kind: How it covers.
    """

    vertices: NDArray[np.float32]
    normals: NDArray[np.float32]
    uv: NDArray[np.float32] | None
    faces: NDArray[np.uint32]
    material: Material
    kind: MaterialKind


def pieces_of(mesh: Mesh) -> list[Piece]:
    """What is seen of a mesh, by material: invisible materials are left out, as the renderers do."""
    normals = _unit(mesh)
    pieces = []
    for number, material in enumerate(mesh.materials):
        kind = material_kind(material)
        mine = np.flatnonzero(mesh.face_material == number)
        if kind is MaterialKind.INVISIBLE or not len(mine):
            continue
        if material.texture is None or 0 in material.texture.shape:
            pieces.append(_piece(mesh, normals, mine, replace(material, texture=None), kind))
            continue
        # A textured face without coordinates shows its texture's mean, as the rasteriser draws it.
        mapped = mesh.corner_uv[mine].any(axis=(1, 2))
        if mapped.any():
            pieces.append(_piece(mesh, normals, mine[mapped], material, kind))
        if not mapped.all():
            mean = np.clip(np.multiply(material.rgba, mean_colour(material.texture)), 0.0, 1.0)
            plain = Material((mean[0], mean[1], mean[2], mean[3]), None, f"{material.name} (mean)")
            pieces.append(_piece(mesh, normals, mine[~mapped], plain, material_kind(plain)))
    return pieces


def _piece(
    mesh: Mesh,
    normals: NDArray[np.float32],
    chosen: NDArray[np.int64],
    material: Material,
    kind: MaterialKind,
) -> Piece:
    """The chosen faces, corners that agree in everything made one vertex."""
    index = mesh.faces[chosen].reshape(-1)
    corner_normals = np.ascontiguousarray(normals[chosen].reshape(-1, 3))
    columns = [index[:, None].astype(np.uint32), corner_normals.view(np.uint32)]
    uv = None
    if material.texture is not None:
        uv = np.ascontiguousarray(mesh.corner_uv[chosen].reshape(-1, 2))
        columns.append(uv.view(np.uint32))
    key = np.ascontiguousarray(np.concatenate(columns, axis=1))
    whole_row = key.view(f"V{4 * key.shape[1]}").ravel()
    _, first, inverse = np.unique(whole_row, return_index=True, return_inverse=True)
    return Piece(
        vertices=mesh.vertices[index[first]],
        normals=corner_normals[first],
        uv=None if uv is None else uv[first],
        faces=inverse.reshape(-1, 3).astype(np.uint32),
        material=material,
        kind=kind,
    )


def _unit(mesh: Mesh) -> NDArray[np.float32]:
    """(F, 3, 3) normals of unit length; stored ones are rounded, and may be zero where a face has no area."""
    normals = agreeing_normals(mesh).astype(np.float64)
    length = np.linalg.norm(normals, axis=2, keepdims=True)
    return np.where(length > 1e-6, normals / np.maximum(length, 1e-6), (0.0, 1.0, 0.0)).astype(np.float32)
