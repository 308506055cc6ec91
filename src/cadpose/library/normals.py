"""Welded vertices and smooth corner normals with a crease angle."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.jit import kernel

CREASE_DEGREES = 40.0
_GRID = (1 << 20) - 1


def weld(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge vertices that lie within a millionth of the bounding box, and drop unused ones.

    Args:
        vertices: (V, 3), finite.
        faces: (F, 3), F >= 1.

    Returns:
        ((W, 3) vertices, (F, 3) faces into them).
    """
    used, inverse = np.unique(faces, return_inverse=True)
    points = vertices[used]
    low = points.min(axis=0)
    extent = float((points.max(axis=0) - low).max()) or 1.0
    cell = np.rint((points - low) * (_GRID / extent)).astype(np.int64)
    key = (cell[:, 0] << 42) | (cell[:, 1] << 21) | cell[:, 2]
    _, first, label = np.unique(key, return_index=True, return_inverse=True)
    return points[first], label[inverse].reshape(-1, 3)


def face_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(F, 3) unit normals (zero where degenerate) and (F,) areas."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    unit = np.divide(cross, length[:, None], out=np.zeros_like(cross), where=length[:, None] > 0)
    return unit, 0.5 * length


def crease_normals(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], crease_degrees: float = CREASE_DEGREES
) -> NDArray[np.float32]:
    """Smooth normals that break at edges sharper than the crease angle.

    Corners that meet over a smooth edge share one normal: the sum of their faces' normals weighted by
    the angle at the corner. Linear in the number of faces, whatever the valence of a vertex.

    Args:
        vertices: (V, 3), welded: neighbours share vertices.
        faces: (F, 3), none degenerate.
        crease_degrees: Largest angle between face normals that still counts as smooth.

    Returns:
        (F, 3, 3) float32 unit normals, one a corner.
    """
    count = len(faces)
    normal, _ = face_normals(vertices, faces)
    heads = faces[:, [1, 2, 0]]
    low, high = np.minimum(faces, heads).ravel(), np.maximum(faces, heads).ravel()
    key = low * np.int64(len(vertices)) + high
    order = np.argsort(key, kind="stable")
    key = key[order]
    starts, ends = [], []
    cosine = np.cos(np.radians(crease_degrees))
    # Double-sided models have four faces at an edge, two of them turned away: look further than one step.
    for lag in (1, 2, 3):
        same = key[lag:] == key[:-lag]
        e, g = order[:-lag][same], order[lag:][same]
        fe, fg = e // 3, g // 3
        smooth = np.einsum("ij,ij->i", normal[fe], normal[fg]) >= cosine
        e, g, fe, fg = e[smooth], g[smooth], fe[smooth], fg[smooth]
        # Half-edge h starts at corner h and ends at corner `nxt`; the other face may run either way.
        e_next, g_next = fe * 3 + (e - fe * 3 + 1) % 3, fg * 3 + (g - fg * 3 + 1) % 3
        flat = faces.ravel()
        aligned = flat[e] == flat[g]
        starts += [e, e_next]
        ends += [np.where(aligned, g, g_next), np.where(aligned, g_next, g)]
    rows, columns = np.concatenate(starts), np.concatenate(ends)
    roots, label = np.unique(_connected(3 * count, rows, columns), return_inverse=True)
    groups = len(roots)

    points = vertices[faces]
    to_next = points[:, [1, 2, 0]] - points
    to_last = points[:, [2, 0, 1]] - points
    scale = np.linalg.norm(to_next, axis=2) * np.linalg.norm(to_last, axis=2)
    cos_corner = np.einsum("fij,fij->fi", to_next, to_last) / np.maximum(scale, 1e-300)
    weight = np.arccos(np.clip(cos_corner, -1.0, 1.0)).ravel()
    weighted = np.repeat(normal, 3, axis=0) * weight[:, None]
    total = np.stack([np.bincount(label, weighted[:, k], minlength=groups) for k in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1)
    corner = total[label] / np.maximum(length, 1e-12)[label, None]
    # A group that cancels itself out (a Moebius strip of faces) falls back to flat shading.
    bad = length[label] < 1e-9
    corner[bad] = np.repeat(normal, 3, axis=0)[bad]
    return np.asarray(corner.reshape(count, 3, 3), dtype=np.float32)


@kernel
def _connected(count: int, a: NDArray[np.int64], b: NDArray[np.int64]) -> NDArray[np.int64]:
    """(count,) the root of every node's component, given the (E,) ends of the edges: union and find."""
    parent = np.arange(count)
    for i in range(len(a)):
        x, y = a[i], b[i]
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        while parent[y] != y:
            parent[y] = parent[parent[y]]
            y = parent[y]
        if x != y:
            parent[max(x, y)] = min(x, y)
    for i in range(count):
        parent[i] = parent[parent[i]]
    return parent
