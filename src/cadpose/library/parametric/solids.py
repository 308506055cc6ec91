"""Coloured parts in the library's axes, collected into one `Mesh`.

Lengths are metres, y is up, the front is -z and the object's own right +x. A `Solid` is a shape without a
colour; a `Builder` collects solids with their `Paint` and makes the mesh. The shapes are in `shapes`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.mesh import Material, Mesh
from cadpose.library.normalise import normalise
from cadpose.library.normals import face_normals
from cadpose.library.parts import Part, assemble

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

_AXES = {"x": 0, "y": 1, "z": 2}


def axis_rotation(axis: str, degrees: float) -> Array:
    """(3, 3) right-handed rotation about ``"x"``, ``"y"`` or ``"z"``."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i = _AXES[axis]
    j, k = (i + 1) % 3, (i + 2) % 3
    matrix = np.eye(3)
    matrix[j, j], matrix[j, k], matrix[k, j], matrix[k, k] = c, -s, s, c
    return matrix


@dataclass(frozen=True, eq=False)
class Paint:
    """How a part looks.

    Attributes:
        material: Colour and texture.
        tile: Metres that one repeat of the texture covers.
        along: The texture's vertical follows the part's longest side, as the grain of wood does.
    """

    material: Material
    tile: float = 0.5
    along: bool = False


@dataclass(frozen=True, eq=False)
class Solid:
    """A shape without a colour. Every method gives a new one.

    Attributes:
        vertices: (V, 3).
        faces: (F, 3), counter-clockwise seen from outside.
        normals: (V, 3), or None to compute them with a crease angle.
        local: (V, 3) where the vertices were when the shape was made; textures are laid on by it.
    """

    vertices: Array
    faces: Ints
    normals: Array | None = None
    local: Array | None = None

    def transformed(self, matrix: ArrayLike, offset: ArrayLike = (0.0, 0.0, 0.0)) -> Solid:
        """Under x -> matrix x + offset; a mirroring (3, 3) matrix also turns the faces around."""
        linear = np.asarray(matrix, np.float64)
        full = np.eye(4)
        full[:3, :3], full[:3, 3] = linear, np.asarray(offset, np.float64)
        part = Part(self.vertices, self.faces, self.normals).transformed(full)
        local = self.vertices if self.local is None else self.local
        return Solid(part.vertices, part.faces, part.normals, local)

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Solid:
        """Shifted by metres."""
        return self.transformed(np.eye(3), (x, y, z))

    def turned(self, axis: str, degrees: float, about: ArrayLike = (0.0, 0.0, 0.0)) -> Solid:
        """Turned about an axis through a point; right-handed."""
        matrix, point = axis_rotation(axis, degrees), np.asarray(about, np.float64)
        return self.transformed(matrix, point - matrix @ point)

    def scaled(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> Solid:
        """Stretched about the origin; a negative factor mirrors."""
        grown = self.transformed(np.diag([x, y, z]))
        local = self.vertices if self.local is None else self.local
        return replace(grown, local=local * np.abs([x, y, z]))

    def mirrored(self, axis: str = "x") -> Solid:
        """Mirrored in the plane through the origin across an axis."""
        signs = np.ones(3)
        signs[_AXES[axis]] = -1.0
        return self.transformed(np.diag(signs))

    def warped(self, bend: Callable[[Array], Array]) -> Solid:
        """With (V, 3) vertices sent through a function; normals are computed anew."""
        local = self.vertices if self.local is None else self.local
        return Solid(np.asarray(bend(self.vertices.copy()), np.float64), self.faces, None, local)

    def pair(self) -> Solid:
        """Together with its mirror image in x."""
        return joined([self, self.mirrored("x")])


def joined(solids: Iterable[Solid]) -> Solid:
    """Several solids as one."""
    several = list(solids)
    offsets = np.cumsum([0, *(len(s.vertices) for s in several[:-1])])
    smooth = all(s.normals is not None for s in several)
    return Solid(
        np.concatenate([s.vertices for s in several]),
        np.concatenate([s.faces + o for s, o in zip(several, offsets, strict=True)]),
        np.concatenate([s.normals for s in several if s.normals is not None]) if smooth else None,
        np.concatenate([s.vertices if s.local is None else s.local for s in several]),
    )


class Builder:
    """Collects painted parts; `mesh` makes the library's mesh of them."""

    def __init__(self) -> None:
        self.parts: list[tuple[Solid, Paint]] = []

    def add(self, paint: Paint, *solids: Solid) -> None:
        """Further parts of one look."""
        self.parts += [(solid, paint) for solid in solids]

    def include(
        self, other: Builder, matrix: ArrayLike | None = None, offset: ArrayLike = (0.0, 0.0, 0.0)
    ) -> None:
        """The parts of another builder under x -> matrix x + offset."""
        linear = np.eye(3) if matrix is None else matrix
        self.parts += [(solid.transformed(linear, offset), paint) for solid, paint in other.parts]

    def bounds(self) -> Array:
        """(2, 3) lowest and highest corner of what was added."""
        points = np.concatenate([solid.vertices for solid, _ in self.parts])
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def mesh(self, name: str) -> Mesh:
        """Normalised to the library's axes: centred, with a bounding-box diagonal of one.

        Raises:
            InputError: nothing with a surface was added.
        """
        parts = [_part(solid, paint) for solid, paint in self.parts]
        return normalise(assemble(parts, name, DEFAULT_LIMITS, lambda _: None))[0]


def _part(solid: Solid, paint: Paint) -> Part:
    if paint.material.texture is None:
        return Part(solid.vertices, solid.faces, solid.normals, None, paint.material)
    local = solid.vertices if solid.local is None else solid.local
    flat = solid.faces.ravel()
    normals = None if solid.normals is None else solid.normals[flat]
    faces = np.arange(len(flat), dtype=np.int64).reshape(-1, 3)
    return Part(solid.vertices[flat], faces, normals, _box_map(local, solid.faces, paint), paint.material)


def _box_map(local: Array, faces: Ints, paint: Paint) -> Array:
    """(3F, 2) texture coordinates: each face looks along its nearest axis."""
    extent = local.max(axis=0) - local.min(axis=0)
    normal, _ = face_normals(local, faces)
    across = np.abs(normal).argmax(axis=1)
    uv = np.empty((len(faces), 3, 2))
    for axis, (u, v) in enumerate(((2, 1), (0, 2), (0, 1))):
        if paint.along and extent[u] > extent[v]:
            u, v = v, u
        here = across == axis
        uv[here] = local[faces[here]][:, :, [u, v]]
    return np.asarray(uv.reshape(-1, 2) / paint.tile)


def points(values: Sequence[ArrayLike]) -> Array:
    """(N, 3) points of a list of triples."""
    return np.asarray(values, np.float64).reshape(-1, 3)
