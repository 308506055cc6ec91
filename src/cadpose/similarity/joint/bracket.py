"""Which rotations are tried, and where between them each model lies best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import geodesic_degrees
from cadpose.geometry.frames import FloatArray
from cadpose.records import RotationHypothesis

#: Hypotheses that are followed, and how far about each views are tried, degrees.
FOLLOWED, RADIUS = 3, 26.0
#: Where the views are sparse, at least so many are tried.
_LEAST_VIEWS = 6
#: What a degree away from a hypothesis costs, and a natural logarithm of its probability.
_COST_DEGREE, _COST_LOG_PROBABILITY = 0.003, 0.02
_LEAST_PROBABILITY = 0.02
#: Views within this angle of the best one, weighted by exp(score / temperature), place the rotation.
_PEAK_RADIUS, _PEAK_TEMPERATURE = 16.0, 0.03
#: That place and the hypothesis are averaged where they are so near: their errors differ.
_SAME = 25.0


@dataclass(frozen=True, eq=False)
class Bracket:
    """K views in question about the hypotheses.

    Attributes:
        hypotheses: (H, 3, 3) rotations.
        near: (K,) indices of the views.
        rotations: (K, 3, 3) theirs.
        cost: (K,) what a view pays for being far from likely rotations.
    """

    hypotheses: FloatArray
    near: NDArray[np.int64]
    rotations: FloatArray
    cost: FloatArray

    @classmethod
    def about(cls, hypotheses: Sequence[RotationHypothesis], rotations: FloatArray) -> Bracket:
        """The views within :data:`RADIUS` of a hypothesis.

        Args:
            hypotheses: Best first, at least one; the first :data:`FOLLOWED` count.
            rotations: (N, 3, 3) of all views.

        Raises:
            ValueError: there is no hypothesis.
        """
        if not hypotheses:
            raise ValueError("a bracket needs a rotation hypothesis")
        followed = hypotheses[:FOLLOWED]
        R = np.stack([h.rotation.to_matrix() for h in followed])
        distance = geodesic_degrees(R[:, None], rotations[None])
        within = np.flatnonzero((distance <= RADIUS).any(axis=0))
        near = np.union1d(within, np.argsort(distance[0], kind="stable")[:_LEAST_VIEWS])
        p = np.array([h.probability for h in followed])
        unlikely = -_COST_LOG_PROBABILITY * np.log(np.clip(p, _LEAST_PROBABILITY, 1.0))
        cost = (_COST_DEGREE * distance[:, near] + unlikely[:, None]).min(axis=0)
        return cls(R, near, rotations[near], cost)

    def settled(self, scores: FloatArray) -> FloatArray:
        """(3, 3) rotation of the best of (K,) scores: between the views, and drawn to the hypothesis.

        Of each two rotations that are averaged the angle is small, so that the mean matrix has one nearest
        rotation.
        """
        best = int(scores.argmax())
        beside = geodesic_degrees(self.rotations[best], self.rotations) <= _PEAK_RADIUS
        weights = np.exp((scores[beside] - scores[best]) / _PEAK_TEMPERATURE)
        peak = _mean(self.rotations[beside], weights)
        away = geodesic_degrees(peak, self.hypotheses)
        nearest = int(away.argmin())
        if away[nearest] > _SAME:
            return peak
        return _mean(np.stack([peak, self.hypotheses[nearest]]), np.ones(2))


def _mean(R: FloatArray, weights: FloatArray) -> FloatArray:
    U, _, Vt = np.linalg.svd(np.einsum("n,nij->ij", weights / weights.sum(), R))
    return np.asarray(U @ Vt)
