"""Rotation without training: compare the photo with renders of CAD models and let them vote.

The photo's Lite0 maps are compared with the templates of every CAD model of the category; a
log-sum-exp over the models turns the cosines into one score a rotation, so that the models most like
the object count most. Peaks of that score, at least 25° apart, are the hypotheses; each is moved
between grid points by a weighted mean of its neighbours.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0
from cadpose.errors import LibraryError
from cadpose.geometry.angles import geodesic_degrees
from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Rotation, RotationHypothesis
from cadpose.rotation.features import Described, describe
from cadpose.rotation.gallery import GalleryStore
from cadpose.rotation.grid import grid_angles, grid_distances, grid_rotations
from cadpose.rotation.templates import Templates

#: Temperature of the vote over CAD models (evidence: 0.05).
_VOTE_TEMPERATURE = 0.05
#: What a turn of 30° in the image plane costs: photographs are mostly upright.
_INPLANE_COST_30 = 0.02
#: Two hypotheses differ by at least this many degrees.
_PEAK_DISTANCE = 25.0
#: Neighbours within this angle, weighted by exp(score / _PEAK_TEMPERATURE), place the peak.
_PEAK_RADIUS = 16.0
_PEAK_TEMPERATURE = 0.01
#: Softmax temperature for the share that a hypothesis gets.
_SHARE_TEMPERATURE = 0.02


class RenderAndCompare:
    """Rotation estimator over cached template galleries.

    Args:
        galleries: Where templates come from.
        encoder: The Lite0 encoder.
        hypotheses: How many rotations to return at most.
        memory_bytes: Templates kept in memory between photos.
    """

    name = "render-and-compare"

    def __init__(
        self,
        galleries: GalleryStore,
        encoder: Lite0,
        *,
        hypotheses: int = 5,
        memory_bytes: int = 1 << 30,
    ) -> None:
        self.galleries = galleries
        self.encoder = encoder
        self.hypotheses = hypotheses
        self.memory_bytes = memory_bytes
        self._kept: OrderedDict[tuple[tuple[str, str], ...], Templates] = OrderedDict()

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> list[RotationHypothesis]:
        """Rotation hypotheses, best first.

        Args:
            crop: (224, 224, 3) uint8, the longer side of the object's box fills the square.
            cads: The CAD models that vote, at least one.

        Raises:
            LibraryError: no CAD model was given.
        """
        if not cads:
            raise LibraryError("no CAD model to compare the photo with, add models of this category")
        return peaks(self.scores(crop, cads), self.hypotheses)

    def scores(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> FloatArray:
        """(N,) vote of the models for every rotation of the grid."""
        vote = voted(self.cosines(describe(self.encoder, crop[None]), cads))
        return np.asarray(vote - _INPLANE_COST_30 * np.abs(grid_angles()[:, 2]) / 30.0)

    def cosines(self, described: Described, cads: Sequence[CadModel]) -> FloatArray:
        """(M, N) likeness of a described crop to every model at every rotation of the grid."""
        return self._templates(cads).cosines(described)

    def cosines_of_each(self, described: Described, cads: Sequence[CadModel]) -> FloatArray:
        """(Q, M, N) likeness of Q described crops to every model at every rotation of the grid."""
        return self._templates(cads).cosines_of_each(described)

    def _templates(self, cads: Sequence[CadModel]) -> Templates:
        key = tuple((cad.id, cad.sha256) for cad in cads)
        if key in self._kept:
            self._kept.move_to_end(key)
        else:
            self._kept[key] = Templates([self.galleries.get(cad) for cad in cads])
            while len(self._kept) > 1 and sum(t.nbytes for t in self._kept.values()) > self.memory_bytes:
                self._kept.popitem(last=False)
        return self._kept[key]


def voted(cosines: FloatArray) -> FloatArray:
    """(M, N) cosines to the (N,) vote of the M models: a log-sum-exp, so that those most alike count most."""
    best = cosines.max(axis=0)
    shares = np.exp((cosines - best) / _VOTE_TEMPERATURE).mean(axis=0)
    return np.asarray(best + _VOTE_TEMPERATURE * np.log(shares))


def peaks(scores: FloatArray, count: int) -> list[RotationHypothesis]:
    """The best ``count`` peaks of (N,) scores over the grid, best first, at least 25° apart."""
    left = scores.copy()
    found: list[tuple[Rotation, float]] = []
    while len(found) < count and np.isfinite(left).any():
        best = int(np.argmax(left))
        R = between_grid_points(scores, best)
        if any(geodesic_degrees(R, other.to_matrix()) < _PEAK_DISTANCE for other, _ in found):
            # On the flank of a better peak the neighbours draw it there; the grid point keeps away.
            R = grid_rotations()[best]
        found.append((Rotation.from_matrix(R), float(scores[best])))
        left[grid_distances()[best] < _PEAK_DISTANCE] = -np.inf
        left[geodesic_degrees(R, grid_rotations()) < _PEAK_DISTANCE] = -np.inf
    values = np.array([score for _, score in found])
    shares = np.exp((values - values[0]) / _SHARE_TEMPERATURE)
    shares /= shares.sum()
    return [
        RotationHypothesis(rotation, score, float(share))
        for (rotation, score), share in zip(found, shares, strict=True)
    ]


def between_grid_points(scores: FloatArray, best: int) -> FloatArray:
    """(3, 3) rotation of the peak at grid point ``best``: its neighbours, averaged by their (N,) scores."""
    near = np.flatnonzero(grid_distances()[best] <= _PEAK_RADIUS)
    # Less the largest: a caller's peak need not be the highest of its neighbours.
    weights = np.exp((scores[near] - scores[near].max()) / _PEAK_TEMPERATURE)
    mean = np.einsum("n,nij->ij", weights / weights.sum(), grid_rotations()[near])
    U, _, Vt = np.linalg.svd(mean)
    # Of rotations so near to one another the nearest orthogonal matrix is a rotation, as near as they are.
    return np.asarray(U @ Vt)
