"""What tells whether a solid is closed and turned the right way."""

from __future__ import annotations

import numpy as np

from cadpose.library.normals import weld
from cadpose.library.parametric.solids import Solid


def volume(solid: Solid) -> float:
    """Signed volume: positive where all faces of a closed solid look outwards."""
    a, b, c = (solid.vertices[solid.faces[:, i]] for i in range(3))
    return float(np.einsum("fi,fi->f", a, np.cross(b, c)).sum() / 6)


def open_edges(solid: Solid) -> int:
    """Edges that an odd number of faces share."""
    _, faces = weld(solid.vertices, solid.faces)
    edges = np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1)
    edges = edges[edges[:, 0] != edges[:, 1]]
    _, count = np.unique(edges, axis=0, return_counts=True)
    return int((count % 2).sum())
