"""Meshes as binary PLY: positions in double precision, normals, and colours at the vertices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh

_VERTEX = np.dtype(
    [
        *((name, "<f8") for name in ("x", "y", "z")),
        *((name, "<f4") for name in ("nx", "ny", "nz")),
        *((name, "u1") for name in ("red", "green", "blue")),
    ]
)
_FACE = np.dtype([("count", "u1"), ("corners", "<i4", (3,))])
_TYPES = {"<f8": "double", "<f4": "float", "|u1": "uchar"}


def ply_bytes(mesh: Mesh, scale: float = 1.0, R_out_from_s: FloatArray | None = None) -> bytes:
    """A mesh as PLY.

    Corners of one position, normal and colour share a vertex. A texture is sampled at the corners, so detail
    within a face is lost; opacity is lost too.

    Args:
        mesh: In the library's axes and unit.
        scale: What positions are multiplied by.
        R_out_from_s: (3, 3) turn of positions and normals; none by default.

    Returns:
        The file's bytes, little-endian.
    """
    turn = np.eye(3) if R_out_from_s is None else R_out_from_s
    colours = corner_colours(mesh)
    # Bits of the normal and the colour beside the position's number: equal rows are one vertex.
    keys = np.concatenate(
        [
            mesh.faces.reshape(-1, 1),
            np.ascontiguousarray(mesh.corner_normals.reshape(-1, 3)).view(np.int32),
            (colours.reshape(-1, 3).astype(np.int32) * np.array([65536, 256, 1])).sum(axis=1, keepdims=True),
        ],
        axis=1,
    ).astype(np.int32)
    rows = np.ascontiguousarray(keys).view([("", np.int32)] * keys.shape[1]).ravel()
    _, first, inverse = np.unique(rows, return_index=True, return_inverse=True)
    vertices = np.zeros(len(first), _VERTEX)
    # Scaled last: what is read back over the scale is the library's position to the last bit but one.
    positions = (mesh.vertices[mesh.faces.reshape(-1)[first]].astype(np.float64) @ turn.T) * scale
    normals = mesh.corner_normals.reshape(-1, 3)[first].astype(np.float64) @ turn.T
    for i, (axis, normal, colour) in enumerate(
        zip(("x", "y", "z"), ("nx", "ny", "nz"), ("red", "green", "blue"), strict=True)
    ):
        vertices[axis], vertices[normal] = positions[:, i], normals[:, i]
        vertices[colour] = colours.reshape(-1, 3)[first, i]
    faces = np.zeros(len(mesh.faces), _FACE)
    faces["count"], faces["corners"] = 3, inverse.reshape(-1, 3)
    properties = [f"property {_TYPES[_VERTEX[name].str]} {name}" for name in _VERTEX.names or ()]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *properties,
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header",
    ]
    return "\n".join(header).encode("ascii") + b"\n" + vertices.tobytes() + faces.tobytes()


def corner_colours(mesh: Mesh) -> NDArray[np.uint8]:
    """(F, 3, 3) sRGB at every corner: the material's colour, times its texture there."""
    base = np.array([material.rgba[:3] for material in mesh.materials])[mesh.face_material]
    colours = np.repeat(base[:, None], 3, axis=1)
    for number, material in enumerate(mesh.materials):
        of_it = mesh.face_material == number
        if material.texture is not None and of_it.any():
            height, width = material.texture.shape[:2]
            u, v = np.moveaxis(mesh.corner_uv[of_it].astype(np.float64), -1, 0)
            column = np.minimum(np.mod(u, 1.0) * width, width - 1).astype(int)
            row = np.minimum(np.mod(1.0 - v, 1.0) * height, height - 1).astype(int)
            colours[of_it] *= material.texture[row, column, :3] / 255.0
    return np.rint(colours * 255.0).astype(np.uint8)
