"""The symmetry of CAD models, as they look from outside, and what to assume where no model is known."""

from __future__ import annotations

import json
import logging
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.symmetry import SymmetryGroup, find_symmetry
from cadpose.library.mesh import FloatArray, Mesh
from cadpose.library.sampling import sample_faces
from cadpose.library.storage import write_atomic

log = logging.getLogger(__name__)

VERSION = 1
"""Part of the name of what is kept on disk: raise it when an unchanged mesh would give another group."""

_SAMPLES = 24_000
_MOST_BYTES = 256 * 1024
# A knob or a label has more of the visible area; an uneven texture on a vase has less.
_OUTLIERS = 0.004
# Knobs and gaps are told from a plain side by how normals differ within so much of the size.
_BEND_SIZE, _BEND_WEIGHT = 0.04, 0.8
_DIRECTIONS = 40
_PIXELS = 64
_DEPTH = 0.008
_HOLE = 0.05
_LEAST_SEEN = 4
# Below this alpha a surface hides nothing behind it; below the lower one it is not seen itself.
_SOLID, _SEEN = 0.6, 0.1

#: What to assume of an object when its CAD model is not known; whatever is not listed has a front. Only
#: categories whose members hardly ever have a handle, a spout or a picture on one side are.
_OF_CATEGORY: dict[str, SymmetryGroup] = {
    **dict.fromkeys(
        ("bottle", "bowl", "can", "glass", "vase", "trash bin", "umbrella"),
        SymmetryGroup.revolution((0.0, 1.0, 0.0)),
    ),
    "ball": SymmetryGroup.sphere(),
}


def category_symmetry(category: str) -> SymmetryGroup:
    """The symmetry to assume of a library category: revolution about y for bottles, bowls, cans, drinking
    glasses, vases, bins and umbrellas, every rotation for balls, else none."""
    return _OF_CATEGORY.get(category, SymmetryGroup.trivial())


def mesh_symmetry(mesh: Mesh, *, tolerance: float = 0.02, samples: int = _SAMPLES) -> SymmetryGroup:
    """The rotations that leave a model as it looks from outside, its colours and textures included.

    What lies hidden inside does not count. A detail counts from about 0.6 % of the visible area on, if it
    stands out by the tolerance or by its colour.

    Args:
        mesh: Any mesh with some area; the group is about the mesh's axes.
        tolerance: See `find_symmetry`.
        samples: Points on the surface, before hidden ones are dropped.
    """
    points, face, weights = sample_faces(mesh, samples, seed=0)
    size = float(np.linalg.norm(np.ptp(points, axis=0)))
    colours, alpha = surface_colours(mesh, face, weights, detail=tolerance * size)
    corner = mesh.corner_normals[face].astype(np.float64)
    normals = np.einsum("nk,nkc->nc", weights, corner)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    out, back = _seen_from(points.astype(np.float64), normals, alpha)
    seen = alpha >= _SEEN
    if seen.sum() < samples // 20:
        seen = np.ones(len(points), np.bool_)
    out, back = out[seen], back[seen]
    bend = _BEND_WEIGHT * _bend(points.astype(np.float64) / (_BEND_SIZE * size), normals)
    # Some files turn normals inwards, and of a single sheet both sides are seen: no side is sure then.
    side = ((out - back) / np.maximum(out + back, 1.0))[:, None]
    # What is hardly seen may be met by what is seen, but need not meet anything itself.
    tested = out + back >= _LEAST_SEEN
    # Glass before something looks unlike it; knobs and gaps look unlike a plain side of the same colour.
    looks = np.concatenate([colours * alpha[:, None] + (1.0 - alpha[:, None]), bend[:, None]], axis=1)
    return find_symmetry(
        points[seen],
        side * normals[seen],
        looks[seen],
        tested=tested if tested.any() else None,
        tolerance=tolerance,
        outliers=_OUTLIERS,
    )


def surface_colours(
    mesh: Mesh, face: NDArray[np.intp], weights: FloatArray, detail: float = 0.0
) -> tuple[FloatArray, FloatArray]:
    """How points on the surface look, unlit: the material's colour times its texture.

    Args:
        mesh: The mesh.
        face: (N,) the triangle of each point.
        weights: (N, 3) barycentric coordinates in it.
        detail: Textures are averaged over patches of this length, in the mesh's units.

    Returns:
        (N, 3) sRGB in [0, 1], and (N,) alpha.
    """
    material = mesh.face_material[face]
    rgba = np.array([m.rgba for m in mesh.materials], np.float64)[material]
    uv = np.einsum("nk,nkc->nc", weights, mesh.corner_uv[face].astype(np.float64))
    uv -= np.floor(uv)
    for number, m in enumerate(mesh.materials):
        here = material == number
        if m.texture is None or not here.any():
            continue
        coarse = _coarse(m.texture, _texels_along(mesh, number, m.texture.shape, detail))
        for image, channel in ((coarse, slice(0, 3)), (m.texture, slice(3, m.texture.shape[2]))):
            height, width = image.shape[:2]
            column = np.minimum((uv[here, 0] * width).astype(np.int64), width - 1)
            row = np.minimum(((1.0 - uv[here, 1]) * height).astype(np.int64), height - 1)
            rgba[here, channel] *= image[row, column, channel].astype(np.float64) / 255.0
    return rgba[:, :3], rgba[:, 3]


def _texels_along(mesh: Mesh, material: int, shape: tuple[int, ...], length: float) -> int:
    """How many texels of a material's texture lie along a length on the surface, on average."""
    faces = mesh.face_material == material
    corners, uv = (
        mesh.vertices[mesh.faces[faces]].astype(np.float64),
        mesh.corner_uv[faces].astype(np.float64),
    )
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    ).sum()
    one, other = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    texels = np.abs(one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]).sum() * shape[0] * shape[1]
    return int(min(length * np.sqrt(texels / max(area, 1e-12)), min(shape[:2])))


def _coarse(texture: NDArray[np.uint8], block: int) -> NDArray[np.uint8]:
    """A texture averaged over square blocks, so that grain and gravel have one colour."""
    if block < 2:
        return texture
    height, width = (side // block * block for side in texture.shape[:2])
    blocks = texture[:height, :width].reshape(height // block, block, width // block, block, -1)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float32), np.uint8)


def _bend(points: FloatArray, normals: FloatArray) -> FloatArray:
    """How much normals differ around each point: 0 on a plain, towards 1 where all directions meet.

    One minus the length of the mean normal over the cubes of side 1 that a point lies in, over four grids.
    """
    bend = np.zeros(len(points))
    for shift in (0.0, 0.25, 0.5, 0.75):
        cell = np.floor(points - points.min(axis=0) + shift).astype(np.int64)
        _, inverse, count = np.unique(
            cell @ np.array([1 << 40, 1 << 20, 1]), return_inverse=True, return_counts=True
        )
        total = np.stack([np.bincount(inverse, weights=normals[:, i]) for i in range(3)], 1)
        bend += 1.0 - (np.linalg.norm(total, axis=1) / count)[inverse]
    return bend / 4.0


def _seen_from(points: FloatArray, normals: FloatArray, alpha: FloatArray) -> tuple[FloatArray, FloatArray]:
    """From how many directions each point is seen on its outer and on its inner side.

    A depth picture made of the points themselves, one a direction: a point is hidden when another one lies
    clearly before it in the same pixel.
    """
    i = np.arange(_DIRECTIONS) + 0.5
    height, around = 1.0 - 2.0 * i / _DIRECTIONS, i * np.pi * (3.0 - np.sqrt(5.0))
    across = np.sqrt(1.0 - height * height)
    directions = np.stack([across * np.cos(around), height, across * np.sin(around)], 1)
    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
    size = float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0
    P = (points - middle) / size
    solid = alpha >= _SOLID
    out, back = np.zeros(len(P)), np.zeros(len(P))
    for d in directions:
        right, up = np.linalg.svd(d[None])[2][1:]
        column, row = (((P @ axis + 0.5) * _PIXELS).astype(np.int64) for axis in (right, up))
        pixel, depth = column * (_PIXELS + 1) + row, -(P @ d)
        first = np.full((_PIXELS + 1) ** 2, np.inf)
        np.minimum.at(first, pixel[solid], depth[solid])
        # A pixel that no outer point fell into lets one look in: its neighbours tell.
        grid = np.pad(first.reshape(_PIXELS + 1, -1), 1, constant_values=np.inf)
        about = np.max([grid[:-2, 1:-1], grid[2:, 1:-1], grid[1:-1, :-2], grid[1:-1, 2:]], axis=0).ravel()
        seen = (depth <= first[pixel] + _DEPTH) & (depth <= about[pixel] + _HOLE)
        facing = normals @ d
        out += seen & (facing > 0.1)
        back += seen & (facing < -0.1)
    return out, back


def kept_symmetry(mesh_file: Path, mesh: Callable[[], Mesh]) -> SymmetryGroup:
    """`mesh_symmetry`, read from a file if it is there, else worked out and written.

    Args:
        mesh_file: Where the mesh is kept; the group lies beside it as JSON. Where that cannot be written the
            group is worked out anew each time.
        mesh: Gives the mesh, if it is needed.
    """
    kept = mesh_file.with_suffix(f".symmetry{VERSION}.json")
    try:
        with kept.open("rb") as file:
            data = file.read(_MOST_BYTES + 1)
        if len(data) <= _MOST_BYTES:
            return SymmetryGroup.from_json(json.loads(data))
    except FileNotFoundError:
        pass
    except (OSError, ValueError, RecursionError):
        log.debug("%s is no symmetry group, worked out anew", kept, exc_info=True)
    group = mesh_symmetry(mesh())
    with suppress(OSError):
        write_atomic(kept, json.dumps(group.to_json()).encode())
    return group


def upright_counts(models: Sequence[tuple[str, SymmetryGroup]]) -> tuple[list[str], dict[str, list[int]]]:
    """How many models a category are alike after which turns about the vertical.

    Args:
        models: (category, group of the model) of each.

    Returns:
        The kinds, lowest order first: ``trivial``, ``C2`` ... ``revolution``; and their counts a category.
    """
    upright = [(category, group.about()) for category, group in models]
    kinds = {group.name: group.order for _, group in upright}
    columns = sorted(kinds, key=lambda name: kinds[name])
    counts = {category: [0] * len(columns) for category in sorted({c for c, _ in upright})}
    for category, group in upright:
        counts[category][columns.index(group.name)] += 1
    return columns, counts
