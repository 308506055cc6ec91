"""Pieces of a model as a decoder delivers them, and how they become one `Mesh`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.library.limits import Limits
from cadpose.library.mesh import Material, Mesh
from cadpose.library.normals import crease_normals, face_normals, weld
from cadpose.library.textures import mean_colour

# Glass that a file makes all but invisible is still seen in a photo, by its reflections.
FAINTEST_ALPHA = 0.2
_INVISIBLE = 0.02


@dataclass(frozen=True, eq=False)
class Part:
    """Triangles of one material.

    Attributes:
        vertices: (V, 3) float64.
        faces: (F, 3) int64.
        normals: (V, 3) as given by the file, or None.
        uv: (V, 2), (0, 0) bottom left, or None.
        material: Colour and texture.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None = None
    uv: NDArray[np.float64] | None = None
    material: Material = Material()

    def transformed(self, matrix: NDArray[np.float64]) -> Part:
        """The part under a (4, 4) transform; a mirroring one also turns the faces around."""
        if np.array_equal(matrix, np.eye(4)):
            return self
        linear = matrix[:3, :3]
        normals = self.normals
        if normals is not None:
            # Cofactor matrix: the inverse transpose without dividing by a determinant that may be zero.
            cofactor = np.stack([np.cross(linear[(i + 1) % 3], linear[(i + 2) % 3]) for i in range(3)])
            normals = normals @ cofactor.T
        faces = self.faces[:, ::-1] if np.linalg.det(linear) < 0 else self.faces
        return replace(self, vertices=self.vertices @ linear.T + matrix[:3, 3], faces=faces, normals=normals)


def colour_palette(part: Part, colours: NDArray[np.generic], linear: bool = False) -> Part:
    """A part coloured a vertex, redrawn as one small texture that holds each face's mean colour.

    Args:
        part: Without a texture.
        colours: (V, 3 or 4), uint8 or uint16 or floats in [0, 1].
        linear: The colours are linear light (glTF) rather than display values.
    """
    if colours.ndim != 2 or len(colours) != len(part.vertices) or colours.shape[1] < 3:
        return part
    top = {"u1": 255.0, "u2": 65535.0}.get(colours.dtype.str[1:], 1.0)
    rgb = np.clip(np.nan_to_num(colours[:, :3].astype(np.float64) / top), 0.0, 1.0)
    if linear:
        rgb = rgb ** (1 / 2.2)
    # 5 bits a channel: at most 32768 colours, a texture of 182 pixels a side.
    face = np.rint(rgb[part.faces].mean(axis=1) * 31.0).astype(np.int64)
    key = (face[:, 0] << 10) | (face[:, 1] << 5) | face[:, 2]
    unique, index = np.unique(key, return_inverse=True)
    side = int(np.ceil(np.sqrt(len(unique))))
    pixels = np.zeros((side * side, 3), dtype=np.uint8)
    pixels[: len(unique)] = np.rint(
        np.stack([(unique >> 10) & 31, (unique >> 5) & 31, unique & 31], axis=1) * (255.0 / 31.0)
    )
    uv_face = np.stack([(index % side + 0.5) / side, 1.0 - (index // side + 0.5) / side], axis=1)
    flat = part.faces.ravel()
    return Part(
        vertices=part.vertices[flat],
        faces=np.arange(len(flat), dtype=np.int64).reshape(-1, 3),
        normals=None if part.normals is None else part.normals[flat],
        uv=np.repeat(uv_face, 3, axis=0),
        material=replace(part.material, texture=pixels.reshape(side, side, 3)),
    )


def assemble(parts: Sequence[Part], name: str, limits: Limits, warn: Callable[[str], None]) -> Mesh:
    """One mesh of all parts: welded, centred, degenerate faces dropped, normals and colours made sane.

    Raises:
        InputError: no face is left, a used vertex is not finite, an index is out of range, or too many.
    """
    parts = [p for p in parts if len(p.faces)]
    if not parts:
        raise InputError(f"{name} has no faces; only surfaces can be drawn.")
    if sum(len(p.faces) for p in parts) > limits.faces:
        raise InputError(f"{name} has more than the {limits.faces} faces allowed.")
    if sum(len(p.vertices) for p in parts) > limits.vertices * 3:
        raise InputError(f"{name} has more than the {limits.vertices} vertices allowed.")
    for part in parts:
        if part.faces.min() < 0 or part.faces.max() >= len(part.vertices):
            raise InputError(f"{name} is damaged: a face names a vertex that does not exist.")
        if not np.isfinite(part.vertices[part.faces]).all():
            raise InputError(f"{name} has vertices that are not finite numbers (NaN or infinity).")
    offsets = np.cumsum([0, *(len(p.vertices) for p in parts)])
    all_faces = np.concatenate([p.faces + o for p, o in zip(parts, offsets[:-1], strict=True)])
    all_vertices = np.concatenate([p.vertices for p in parts])
    if np.abs(all_vertices[all_faces]).max() > 1e12:
        raise InputError(f"{name} has vertices too far out to compute with.")
    vertices, faces = weld(all_vertices, all_faces)
    # Map coordinates lie millions of metres out, where float32 steps are half a metre.
    vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    _, area = face_normals(vertices, faces)
    diagonal = float(np.linalg.norm(vertices.max(axis=0) - vertices.min(axis=0)))
    keep = area > 1e-13 * diagonal**2
    if not keep.any():
        raise InputError(f"{name} has no face with an area; only surfaces can be drawn.")

    faces, source = faces[keep], all_faces[keep]
    owner = np.repeat(np.arange(len(parts)), [len(p.faces) for p in parts])[keep]
    materials, number = _merge(_visible_materials(parts, warn))
    kept_vertices, compact = np.unique(faces, return_inverse=True)
    return Mesh(
        vertices=vertices[kept_vertices].astype(np.float32),
        faces=compact.reshape(-1, 3).astype(np.int32),
        corner_normals=_corner_normals(parts, vertices, faces, source, offsets, owner),
        corner_uv=_corner_uv(parts, source),
        face_material=number[owner],
        materials=materials,
    )


def _merge(materials: Sequence[Material]) -> tuple[tuple[Material, ...], NDArray[np.int32]]:
    """The different materials, and each old number's new one."""
    known: dict[tuple[tuple[float, ...], int], int] = {}
    kept: list[Material] = []
    number: list[int] = []
    for material in materials:
        key = (material.rgba, id(material.texture))
        if key not in known:
            known[key] = len(kept)
            kept.append(material)
        number.append(known[key])
    return tuple(kept), np.array(number, dtype=np.int32)


def _corner_normals(
    parts: Sequence[Part],
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    source: NDArray[np.int64],
    offsets: NDArray[np.int64],
    owner: NDArray[np.int64],
) -> NDArray[np.float32]:
    computed = crease_normals(vertices, faces)
    if all(p.normals is None or len(p.normals) != len(p.vertices) for p in parts):
        return computed
    given = np.zeros((int(offsets[-1]), 3))
    for part, offset in zip(parts, offsets[:-1], strict=True):
        if part.normals is not None and len(part.normals) == len(part.vertices):
            given[offset : offset + len(part.vertices)] = np.nan_to_num(
                part.normals.astype(np.float64), posinf=0.0, neginf=0.0
            )
    corner = given[source]
    length = np.linalg.norm(corner, axis=2, keepdims=True)
    unit = corner / np.maximum(length, 1e-12)
    # A normal in its own face's plane or behind it is a leftover of a bad export, not shading.
    facing = np.einsum("fij,fij->fi", unit, computed)
    good = (length[..., 0] > 1e-6) & (np.abs(facing) > 0.2)
    return np.where(good[..., None], unit, computed).astype(np.float32)


def _corner_uv(parts: Sequence[Part], source: NDArray[np.int64]) -> NDArray[np.float32]:
    uv = np.concatenate(
        [
            p.uv if p.uv is not None and len(p.uv) == len(p.vertices) else np.zeros((len(p.vertices), 2))
            for p in parts
        ]
    )
    corner = np.nan_to_num(uv[source][..., :2], posinf=0.0, neginf=0.0)
    # Whole repeats away from the origin cost precision and change nothing.
    return np.asarray(corner - np.floor(corner.min(axis=1, keepdims=True)), dtype=np.float32)


def _visible_materials(parts: Sequence[Part], warn: Callable[[str], None]) -> tuple[Material, ...]:
    out: list[Material] = []
    for part in parts:
        material = part.material
        if material.texture is not None and (part.uv is None or len(part.uv) != len(part.vertices)):
            warn(f"material {material.name!r} has a texture but no coordinates; its mean colour is used")
            r, g, b, a = (x * y for x, y in zip(mean_colour(material.texture), material.rgba, strict=True))
            material = Material((r, g, b, a), None, material.name)
        out.append(material)
    if all(m.rgba[3] < _INVISIBLE for m in out):
        # Some exporters write opacity where the format wants transparency.
        warn("every material is wholly transparent; they are drawn opaque")
        return tuple(replace(m, rgba=(*m.rgba[:3], 1.0)) for m in out)
    return tuple(
        replace(m, rgba=(*m.rgba[:3], FAINTEST_ALPHA)) if m.rgba[3] < FAINTEST_ALPHA else m for m in out
    )
