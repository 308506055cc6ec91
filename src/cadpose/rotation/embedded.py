"""The default rotation estimator: the embedded network proposes, render-and-compare ranks, both are averaged.

The network says which rotations are likely, whatever the CAD models are; the vote of the models' templates
says which of them look like the photo. A proposal's score adds the two. Where they agree on the best one the
answer is seldom wrong, and where they do not it often is: that is what the calibrated probability is made of.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0
from cadpose.errors import DependencyError, LibraryError
from cadpose.geometry.angles import angles_from_rotation, geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.records import CadModel, Rotation, RotationHypothesis
from cadpose.rotation.calibration import Calibration
from cadpose.rotation.features import describe
from cadpose.rotation.grid import grid_angles, grid_mirrored, grid_rotations
from cadpose.rotation.network import AngleDistributions, RotationNetwork
from cadpose.rotation.render_and_compare import RenderAndCompare, between_grid_points, voted

#: Proposals differ by at least this many degrees, before each is drawn to the peak beside it.
_APART = 25.0
#: Triples of bins that proposals are picked from.
_TRIPLES = 40
#: Cosines of the vote are divided by this before they are added to the log probability, where the best of
#: them is _USUAL_LIKENESS. The vote counts the more, by the square, the more a template is like the photo:
#: a model that is nearly the object's own knows its rotation, models that are not like it know little.
_VOTE_TEMPERATURE = 0.045
_USUAL_LIKENESS = 0.3
_LEAST_LIKENESS = 0.05
#: Weight of the log probability beside the vote.
_NETWORK_WEIGHT = 1.0
#: The vote of grid points within this angle speaks for a rotation, degrees.
_NEAR = 12.0
#: Share of a proposal where the peak of both is near enough to be averaged with.
_NETWORK_SHARE = 0.5
#: Natural logarithms of odds at which a lead over the other proposals says all that it can.
_SURE = 4.0
#: In-plane rotations between which an object is looked at again upright, degrees.
_ASKEW, _OVERTURNED = 10.0, 60.0
#: The shipped calibration, fitted by scripts/fit_rotation_calibration.py.
CALIBRATION = "rotation-calibration.json"
#: Names of the features that the probability is made of.
FEATURES = ("margin", "network", "vote", "apart", "grid", "likeness")
_LIKENESS = FEATURES.index("likeness")


@dataclass(frozen=True, eq=False)
class Proposals:
    """K proposals of one crop, best first.

    Attributes:
        R_cv_from_s: (K, 3, 3) rotations.
        scores: (K,) vote and log probability together.
        features: (K, F) what the probability is made of, see :data:`FEATURES`.
    """

    R_cv_from_s: FloatArray
    scores: FloatArray
    features: FloatArray


class EmbeddedRotation:
    """Rotation estimator of the default pipeline.

    Args:
        compare: Render-and-compare over the cached templates.
        encoder: The shared Lite0 encoder.
        network: The embedded network; None for the shipped one.
        symmetry: Gives the rotations that leave a model as it looks; None takes every model as having none.
        hypotheses: How many rotations to return at most.
        calibration: From features to probability; None for the shipped one.
    """

    name = "embedded"

    def __init__(
        self,
        compare: RenderAndCompare,
        encoder: Lite0,
        *,
        network: RotationNetwork | None = None,
        symmetry: Callable[[CadModel], SymmetryGroup] | None = None,
        hypotheses: int = 5,
        calibration: Calibration | None = None,
    ) -> None:
        self.compare = compare
        self.encoder = encoder
        self.network = network or RotationNetwork()
        self.symmetry = symmetry
        self.hypotheses = hypotheses
        self._calibration = calibration
        self._groups: dict[tuple[str, str], SymmetryGroup] = {}

    @cached_property
    def calibration(self) -> Calibration:
        """What turns features into a probability and an expected error."""
        if self._calibration is not None:
            return self._calibration
        kept = Path(str(files("cadpose") / "data" / CALIBRATION))
        if not kept.is_file():
            raise DependencyError(f"there is no rotation calibration at {kept}: reinstall cadpose.")
        fitted = Calibration.from_json(kept.read_text(encoding="utf-8"), kept.name)
        if fitted.names != FEATURES:
            raise DependencyError(f"{kept} is of another version of cadpose: reinstall cadpose.")
        return fitted

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> list[RotationHypothesis]:
        """Rotation hypotheses, best first, each with a calibrated probability to be within 30°.

        Args:
            crop: (224, 224, 3) uint8, the longer side of the object's box fills the square.
            cads: The CAD models that vote, at least one; all of one category.

        Raises:
            LibraryError: no CAD model was given.
        """
        found = self.propose(crop, cads)
        probability = self.calibration.probability(found.features)
        expected = self.calibration.expected_error(found.features)
        review = self.calibration.needs_review(found.features)
        return [
            RotationHypothesis(
                Rotation.from_matrix(R), float(score), float(p), expected_error=float(e), needs_review=bool(r)
            )
            for R, score, p, e, r in zip(
                found.R_cv_from_s, found.scores, probability, expected, review, strict=True
            )
        ]

    def propose(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> Proposals:
        """What :meth:`estimate` makes hypotheses of.

        An object that seems turned in the image plane is looked at again upright: the templates are sparse,
        and the network has seen little, where objects lie askew. The look at which a template is more like
        the photo counts.

        Raises:
            LibraryError: no CAD model was given.
        """
        if not cads:
            raise LibraryError("no CAD model to compare the photo with, add models of this category")
        first = self._look(crop, cads)
        inplane = float(angles_from_rotation(first.R_cv_from_s[0])[2])
        if not _ASKEW <= abs(inplane) <= _OVERTURNED:
            return first
        upright = self._look(_turned(crop, -inplane), cads)
        if upright.features[0, _LIKENESS] <= first.features[0, _LIKENESS]:
            return first
        azimuth, elevation, rest = angles_from_rotation(upright.R_cv_from_s)
        R = rotation_from_angles(azimuth, elevation, rest + inplane)
        return replace(upright, R_cv_from_s=R)

    def _look(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> Proposals:
        both = np.stack([crop, crop[:, ::-1]])
        described = describe(self.encoder, both)
        angles = self.network.look(both, described, cads[0].category, (False, True))
        cosines, mirrored = self.compare.cosines_of_each(described, cads)
        # Nearly all objects are their own mirror image, so the mirrored crop is a second witness.
        vote = (voted(cosines) + voted(mirrored)[grid_mirrored()]) / 2.0
        best_cad = cads[int(cosines.max(axis=1).argmax())]
        return fused(angles, vote, self._group(best_cad), self.hypotheses)

    def _group(self, cad: CadModel) -> SymmetryGroup:
        """The model's symmetry about its upright axis, asked for once: it may have to be worked out."""
        if self.symmetry is None:
            return SymmetryGroup.trivial()
        key = (cad.id, cad.sha256)
        if key not in self._groups:
            self._groups[key] = self.symmetry(cad).about()
        return self._groups[key]


def fused(angles: AngleDistributions, vote: FloatArray, group: SymmetryGroup, count: int) -> Proposals:
    """Proposals of the network and peaks of the vote, scored by both.

    Args:
        angles: What the network says.
        vote: (N,) of the templates' rotations.
        group: Rotations that look the same; of those only the best is kept.
        count: Proposals to keep at most.
    """
    triples, chances = angles.likeliest(_TRIPLES)
    R_net = rotation_from_angles(*triples.T)
    likeness = max(float(vote.max()), _LEAST_LIKENESS)
    temperature = _VOTE_TEMPERATURE * (_USUAL_LIKENESS / likeness) ** 2
    total = vote / temperature + _NETWORK_WEIGHT * angles.density(grid_angles())
    peak = int(total.argmax())
    pool = np.concatenate([R_net, between_grid_points(total * temperature, peak)[None]])
    log_chance = np.append(np.log(chances + 1e-9), angles.density(grid_angles()[peak : peak + 1]))
    near = _near_vote(pool, vote)
    score = near / temperature + _NETWORK_WEIGHT * log_chance
    chosen: list[int] = []
    for k in np.argsort(-score, kind="stable"):
        apart = [float(group.geodesic_degrees(pool[k], pool[j])) for j in chosen]
        if not chosen or min(apart) >= _APART:
            chosen.append(int(k))
        if len(chosen) == count:
            break
    R = np.stack([_settled(pool[k], total * temperature) for k in chosen])
    best = score[chosen]
    rest = np.array(
        [
            np.logaddexp.reduce(np.delete(best, k)) if len(best) > 1 else best[k] - 10.0
            for k in range(len(best))
        ]
    )
    from_network = group.geodesic_degrees(R, np.broadcast_to(R_net[0], R.shape))
    from_vote = group.geodesic_degrees(R, np.broadcast_to(grid_rotations()[int(vote.argmax())], R.shape))
    features = np.stack(
        [
            np.tanh((best - rest) / _SURE),
            np.clip(log_chance[chosen], -10.0, 0.0),
            near[chosen] - vote.max(),
            np.minimum(from_network, 60.0) / 60.0,
            np.minimum(from_vote, 60.0) / 60.0,
            np.full(len(chosen), likeness),
        ],
        axis=1,
    )
    return Proposals(R, best, features)


def _turned(crop: NDArray[np.uint8], degrees: float) -> NDArray[np.uint8]:
    """The crop turned counter-clockwise about its middle, white where it shows nothing.

    Its scale is kept: the longer side of an object's rectangle changes little with turns of up to 30°.
    """
    middle = ((crop.shape[1] - 1) / 2.0, (crop.shape[0] - 1) / 2.0)
    matrix = cv2.getRotationMatrix2D(middle, degrees, 1.0)
    size = (crop.shape[1], crop.shape[0])
    turned = cv2.warpAffine(crop, matrix, size, flags=cv2.INTER_LINEAR, borderValue=(255, 255, 255))
    return np.asarray(turned, np.uint8)


def _near_vote(R: FloatArray, vote: FloatArray) -> FloatArray:
    """(K, 3, 3) rotations to the (K,) best vote near each, a little less for one farther off."""
    distance = geodesic_degrees(R[:, None], grid_rotations()[None])
    nearest = distance.min(axis=1, keepdims=True)
    counted = np.where(distance <= np.maximum(_NEAR, nearest + 1e-6), vote[None] - 0.0005 * distance, -np.inf)
    return np.asarray(counted.max(axis=1))


def _settled(R: FloatArray, total: FloatArray) -> FloatArray:
    """A proposal, averaged with the peak of both together, on the scale of the vote, where that is near."""
    distance = geodesic_degrees(R, grid_rotations())
    near = np.flatnonzero(distance <= _NEAR)
    if not len(near):
        return R
    peak = between_grid_points(total, int(near[total[near].argmax()]))
    if geodesic_degrees(R, peak) > 1.5 * _NEAR:
        return R
    U, _, Vt = np.linalg.svd(_NETWORK_SHARE * R + (1.0 - _NETWORK_SHARE) * peak)
    return np.asarray(U @ Vt)
