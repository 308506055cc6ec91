"""Coarse to fine: all models from all rotations in question, then the best few drawn and matched.

1. Cached views of every model about the rotation hypotheses are compared with the crop cell by cell; each
   model's rotation settles where it is most alike.
2. At that rotation cells of crop and cached view are matched, and RANSAC counts those that agree.
3. The best few are drawn at their own rotation and compared as :class:`cadpose.similarity.fused.Fused`
   does, at a tighter residual.

Nothing here looks at the object's mask: the IoU of silhouette and estimated mask was measured to help none.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE, Lite0, lite0
from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Candidate, Rotation, RotationHypothesis, Views
from cadpose.similarity.affine import ransac_affine
from cadpose.similarity.aligned import compare, describe_views
from cadpose.similarity.fused import Fused, share_of_most
from cadpose.similarity.joint.bracket import Bracket
from cadpose.similarity.joint.confidence import Confidence, Evidence
from cadpose.similarity.joint.templates import CELLS, TemplateSource, TemplateViews, template_cosines
from cadpose.similarity.local_features import BACKGROUND, DenseLite0, Features, unit
from cadpose.similarity.matching import mutual_nearest
from cadpose.threads import spread

#: Models that are drawn at most.
DRAWN = 5
#: Weight of the cached views' aspect against the box's, of their inliers among themselves, and of their
#: likeness beside what the drawn models get.
_COARSE_ASPECT, _COARSE_INLIERS, _COARSE_SHARE = 0.2, 0.5, 0.5
#: RANSAC's residual in pixels of 224, and its trials on cached views and on renders.
_RESIDUAL_PX, _COARSE_TRIALS, _TRIALS = 20.0, 400, 500
_CENTRES = (np.arange(CELLS) + 0.5) * (SIDE / CELLS)
_GRID = np.stack(np.meshgrid(_CENTRES, _CENTRES), axis=-1).reshape(-1, 2)


@dataclass(frozen=True, eq=False)
class JointRanking:
    """The answer for one object.

    Attributes:
        candidates: Best first, each at its own rotation and with its chance to be the object's model.
        none_probability: Chance that none of them is.
        needs_review: Whether a person should look before the first one is used.
        evidence: What the chances are made of.
    """

    candidates: tuple[Candidate, ...]
    none_probability: float
    needs_review: bool
    evidence: Evidence


@dataclass(frozen=True, eq=False)
class Look:
    """What cached views tell of M models.

    Attributes:
        likeness: (M,) of the best view in question, less what its rotation and its aspect cost.
        inliers: (M,) of the cells of crop and that view.
        rotations: (M, 3, 3) where each model lies best.
    """

    likeness: FloatArray
    inliers: FloatArray
    rotations: FloatArray

    @property
    def scores(self) -> FloatArray:
        """(M,) both together: who is drawn."""
        return self.likeness + _COARSE_INLIERS * share_of_most(self.inliers)


class JointRanker:
    """Decides CAD model and rotation together.

    Args:
        source: The models' cached views.
        render: Draws a model at (N, 3, 3) rotations, framed as the crop is.
        encoder: The process's shared Lite0 if None.
        seed: RANSAC's seed.
        confidence: From evidence to chances; None for the shipped one.
        shared: Whether several threads may call ``render`` at once.
    """

    name = "joint"

    def __init__(
        self,
        source: TemplateSource,
        render: Callable[[CadModel, FloatArray], Views],
        encoder: Lite0 | None = None,
        seed: int = 0,
        confidence: Confidence | None = None,
        *,
        shared: bool = False,
    ) -> None:
        self.source = source
        self.render = render
        self.encoder = lite0() if encoder is None else encoder
        self.dense = DenseLite0(encoder=self.encoder)
        self.seed = seed
        self.shared = shared
        self._confidence = confidence

    @property
    def confidence(self) -> Confidence:
        """What turns evidence into chances.

        Raises:
            DependencyError: the shipped one is missing or of another version.
        """
        if self._confidence is None:
            self._confidence = Confidence.shipped()
        return self._confidence

    def rank(
        self,
        crop: NDArray[np.uint8],
        cached_crop: NDArray[np.uint8],
        aspect: float,
        cads: Sequence[CadModel],
        hypotheses: Sequence[RotationHypothesis],
        *,
        fixed: bool = False,
    ) -> JointRanking:
        """All models, best first.

        Args:
            crop: (224, 224, 3) uint8, the object's box letterboxed over :data:`BACKGROUND`.
            cached_crop: The same over the source's own background.
            aspect: Width / height of the box.
            cads: At least one model, each once.
            hypotheses: How the object may be turned, best first, at least one.
            fixed: The first hypothesis is how it is turned: every model is seen at it.

        Raises:
            ValueError: there is no model or no hypothesis.
            LibraryError: a model cannot be drawn.
        """
        ranked, evidence = self.compare(crop, cached_crop, aspect, cads, hypotheses, fixed=fixed)
        chances = self.confidence.chances(evidence, [c.score for c in ranked])
        return JointRanking(
            tuple(replace(c, probability=float(p)) for c, p in zip(ranked, chances.candidates, strict=True)),
            chances.none,
            chances.needs_review,
            evidence,
        )

    def compare(
        self,
        crop: NDArray[np.uint8],
        cached_crop: NDArray[np.uint8],
        aspect: float,
        cads: Sequence[CadModel],
        hypotheses: Sequence[RotationHypothesis],
        *,
        fixed: bool = False,
    ) -> tuple[list[Candidate], Evidence]:
        """As :meth:`rank`, without chances: what a confidence is fitted on."""
        if not cads:
            raise ValueError("ranking needs at least one CAD model")
        look = self.look(cached_crop, aspect, cads, hypotheses, fixed=fixed)
        order = np.argsort(-look.scores, kind="stable")
        best, after = order[:DRAWN], order[DRAWN:]
        aligned, inliers = self.drawn(crop, aspect, [cads[i] for i in best], look.rotations[best])
        scores = np.empty(len(cads))
        scores[best] = Fused.combine(aligned, inliers) + _COARSE_SHARE * look.likeness[best]
        # Those that were not drawn follow in their order.
        scores[after] = scores[best].min() + look.scores[after] - look.scores[best].min()
        measures = [
            {"cached-aligned": float(a), "cached-inliers": float(n)}
            for a, n in zip(look.likeness, look.inliers, strict=True)
        ]
        for i, a, n in zip(best, aligned, inliers, strict=True):
            measures[i] |= {"aligned": float(a), "inliers": float(n)}
        ranked = [*best[np.argsort(-scores[best], kind="stable")], *after]
        candidates = [
            Candidate(
                cads[i],
                float(scores[i]),
                hypotheses[0].rotation if fixed else Rotation.from_matrix(look.rotations[i]),
                measures[i],
            )
            for i in ranked
        ]
        return candidates, Evidence.of(candidates, hypotheses)

    def look(
        self,
        cached_crop: NDArray[np.uint8],
        aspect: float,
        cads: Sequence[CadModel],
        hypotheses: Sequence[RotationHypothesis],
        *,
        fixed: bool = False,
    ) -> Look:
        """What the cached views tell, without drawing; arguments as for :meth:`rank`."""
        views = [self.source.views(cad) for cad in cads]
        bracket = Bracket.about(hypotheses[:1] if fixed else hypotheses, self.source.rotations)
        cells = self.source.describe(cached_crop)
        shape = np.stack([np.abs(np.log(aspect / v.aspect[bracket.near])) for v in views])
        scores = template_cosines(cells, views, bracket.near) - bracket.cost - _COARSE_ASPECT * shape
        rotations = [bracket.hypotheses[0] if fixed else bracket.settled(some) for some in scores]
        inliers = self._matched(cells, views, bracket.near[scores.argmax(axis=1)])
        return Look(scores.max(axis=1), inliers, np.stack(rotations))

    def _matched(
        self, cells: NDArray[np.int8], views: Sequence[TemplateViews], at: NDArray[np.int64]
    ) -> FloatArray:
        """(M,) inliers between the crop's cells and those of each model's cached view."""
        crop = _centred(cells * self.source.spread)

        def count(one: TemplateViews, n: int) -> int:
            inside = one.cover[n] >= 0.5
            if not inside.any():
                return 0
            pairs = mutual_nearest(crop, _centred(one.cells[n][inside] * self.source.spread))
            return self._inliers(_GRID[pairs[:, 0]], _GRID[inside][pairs[:, 1]], _COARSE_TRIALS)

        return np.array(spread(lambda one: count(*one), zip(views, at, strict=True)), np.float64)

    def drawn(
        self, crop: NDArray[np.uint8], aspect: float, cads: Sequence[CadModel], R_cv_from_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """(K,) aligned scores and (K,) inliers of K models drawn at (K, 3, 3) rotations."""
        posed = [(cad, R[None]) for cad, R in zip(cads, R_cv_from_s, strict=True)]
        if self.shared:
            views = Views.joined(spread(lambda one: self.render(*one), posed))
        else:
            views = Views.joined([self.render(*one) for one in posed])
        images = np.concatenate([crop[None], views.over(BACKGROUND)])
        maps = self.dense.encode(images)
        small = maps[self.dense.sides.index(SIDE)]
        aligned = compare(small[0], describe_views(views, maps=small[1:]), aspect=aspect)
        mine = self.dense.describe(images[:1], maps=[m[:1] for m in maps])[0]
        theirs = self.dense.describe(images[1:], views.mask, maps=[m[1:] for m in maps])
        return aligned, np.array(spread(lambda other: float(self._dense_inliers(mine, other)), theirs))

    def _dense_inliers(self, crop: Features, view: Features) -> int:
        pairs = mutual_nearest(crop.descriptors, view.descriptors)
        return self._inliers(crop.xy[pairs[:, 0]], view.xy[pairs[:, 1]], _TRIALS)

    def _inliers(self, source: FloatArray, target: FloatArray, trials: int) -> int:
        return ransac_affine(source, target, residual_px=_RESIDUAL_PX, trials=trials, seed=self.seed).count


def _centred(cells: NDArray[np.float32]) -> NDArray[np.float32]:
    """(P, C) cells less their mean, of unit length."""
    return unit(np.asarray(cells - cells.mean(axis=0), np.float32))
