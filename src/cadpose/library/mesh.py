"""A triangle mesh with materials, as flat arrays that the renderers read."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# The 26 directions to the faces, edges and corners of a cube.
_DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])


@dataclass(frozen=True, eq=False)
class Material:
    """How a face looks.

    Attributes:
        rgba: Base colour, four values in [0, 1], as displayed (sRGB); alpha < 1 is see-through.
        texture: (H, W, 3) or (H, W, 4) uint8 sRGB image whose first row is the top (v = 1), or None.
            A texture is multiplied by ``rgba``, as in glTF; importers of OBJ set ``rgba`` to white
            where a diffuse map is given.
        name: The material's name in its file.
    """

    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)
    texture: NDArray[np.uint8] | None = None
    name: str = ""

    def __post_init__(self) -> None:
        if len(self.rgba) != 4 or not all(0.0 <= c <= 1.0 for c in self.rgba):
            raise ValueError(f"material {self.name!r}: rgba must be four values in [0, 1], got {self.rgba}")
        if self.texture is not None and (
            self.texture.dtype != np.uint8 or self.texture.ndim != 3 or self.texture.shape[2] not in (3, 4)
        ):
            raise ValueError(f"material {self.name!r}: a texture is (H, W, 3 or 4) uint8")


@dataclass(frozen=True, eq=False)
class Mesh:
    """V vertices and F triangles in ShapeNet axes (y up, front -z) once normalised.

    Attributes:
        vertices: (V, 3) float32.
        faces: (F, 3) int32 indices into ``vertices``.
        corner_normals: (F, 3, 3) float32 unit normals, one a triangle corner.
        corner_uv: (F, 3, 2) float32 texture coordinates, (0, 0) bottom left; zeros where there are none.
        face_material: (F,) int32 indices into ``materials``.
        materials: At least one.

    Raises:
        ValueError: shapes disagree, an index is out of range, a value is not finite, or there is no face.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    corner_normals: NDArray[np.float32]
    corner_uv: NDArray[np.float32]
    face_material: NDArray[np.int32]
    materials: tuple[Material, ...] = field(default_factory=lambda: (Material(),))

    def __post_init__(self) -> None:
        f = len(self.faces)
        spec: dict[str, tuple[type[np.generic], tuple[int, ...]]] = {
            "vertices": (np.float32, (len(self.vertices), 3)),
            "faces": (np.int32, (f, 3)),
            "corner_normals": (np.float32, (f, 3, 3)),
            "corner_uv": (np.float32, (f, 3, 2)),
            "face_material": (np.int32, (f,)),
        }
        for name, (dtype, shape) in spec.items():
            array = np.ascontiguousarray(getattr(self, name), dtype=dtype).view()
            if array.shape != shape:
                raise ValueError(f"Mesh.{name} has shape {array.shape}, expected {shape}")
            if dtype is np.float32 and not np.isfinite(array).all():
                raise ValueError(f"Mesh.{name} holds a value that is not finite")
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if f == 0:
            raise ValueError("a mesh needs at least one face")
        if self.faces.min() < 0 or self.faces.max() >= len(self.vertices):
            raise ValueError("Mesh.faces points outside the vertices")
        if not self.materials:
            raise ValueError("a mesh needs at least one material")
        if self.face_material.min() < 0 or self.face_material.max() >= len(self.materials):
            raise ValueError("Mesh.face_material points outside the materials")

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) lowest and highest corner over the vertices that a face uses."""
        used = self.vertices[np.unique(self.faces)].astype(np.float64)
        return np.stack([used.min(axis=0), used.max(axis=0)])

    @cached_property
    def hull(self) -> FloatArray:
        """(P, 3) vertices among which the extremes of every projection lie.

        All vertices of the convex hull are there; most of those inside it are not.
        """
        used = np.unique(self.vertices[np.unique(self.faces)].astype(np.float64), axis=0)
        return used[~_strictly_inside(used)]


def _strictly_inside(points: FloatArray) -> NDArray[np.bool_]:
    """(P,) whether a point lies within the hull of a few extreme ones, and so cannot be extreme itself."""
    along = np.linalg.norm(_DIRECTIONS, axis=1)
    few = points[np.unique((points @ (_DIRECTIONS / along[:, None]).T).argmax(axis=0))]
    inside = np.zeros(len(points), np.bool_)
    if len(few) < 4:
        return inside
    # Every plane through three of the few that has all of them on one side bounds their hull.
    i, j, k = np.array(list(combinations(range(len(few)), 3))).T
    normal = np.cross(few[j] - few[i], few[k] - few[i])
    length = np.linalg.norm(normal, axis=1)
    proper = length > 1e-9
    normal, offset = normal[proper] / length[proper, None], few[i][proper]
    height = few @ normal.T - np.einsum("fi,fi->f", offset, normal)
    slack = 1e-6
    below, above = (height <= slack).all(axis=0), (height >= -slack).all(axis=0)
    bounds = (below | above) & ~(below & above)
    if not bounds.any():
        return inside
    outward = normal[bounds] * np.where(below[bounds], 1.0, -1.0)[:, None]
    return np.asarray(
        (points @ outward.T < np.einsum("fi,fi->f", offset[bounds], outward) - slack).all(axis=1)
    )
