"""The paper's similarity: local features, matching, RANSAC affine, and SM1, SM2 or SM3 of the inliers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views
from cadpose.similarity import measures
from cadpose.similarity.affine import AffineFit, ransac_affine
from cadpose.similarity.delf.features import Delf
from cadpose.similarity.local_features import BACKGROUND, DenseLite0, Features, LocalFeatures, Sift
from cadpose.similarity.matching import FloatMatrix, Pairs, mutual_nearest, nearest_within
from cadpose.similarity.xfeat import XFeat

Measure = Literal["sm1", "sm2", "sm3", "sm1_normalised", "sm3_normalised"]
Matcher = Callable[[FloatMatrix, FloatMatrix], Pairs]


@dataclass(frozen=True, eq=False)
class ViewMatches:
    """The crop matched with one render; pixels of both brought to 224 x 224.

    Attributes:
        crop_xy: (M, 2) points of the crop.
        view_xy: (M, 2) their matches in the render.
        fit: The affine map crop to render and its inliers.
    """

    crop_xy: FloatArray
    view_xy: FloatArray
    fit: AffineFit


@dataclass(frozen=True, eq=False)
class AffineComparison:
    """The crop compared with N renders by every measure of the paper.

    Attributes:
        matches: N, one a render.
        scores: (N,) scores by measure: ``sm1``, ``sm2``, ``sm3`` as printed, and ``sm1_normalised``,
            ``sm3_normalised``.
    """

    matches: tuple[ViewMatches, ...]
    scores: dict[Measure, FloatArray]


class LocalAffine:
    """A :class:`cadpose.similarity.SimilarityMeasure` of the paper's kind.

    SM1 looks at all renders at once (the five smallest epsilon), so give it one render a candidate.

    Args:
        features: What is matched.
        measure: Which of the paper's measures :meth:`score` returns.
        matcher: How descriptors are paired; mutual nearest neighbours unless told.
        residual_px: RANSAC's residual in pixels of the 224 px square.
        trials: RANSAC's trials.
        seed: RANSAC's seed.
    """

    def __init__(
        self,
        features: LocalFeatures,
        measure: Measure = "sm2",
        *,
        matcher: Matcher = mutual_nearest,
        residual_px: float = 28.0,
        trials: int = 1000,
        seed: int = 0,
    ) -> None:
        if measure not in get_args(Measure):
            raise ValueError(f"measure {measure!r} is none of {', '.join(get_args(Measure))}")
        self.features = features
        self.measure: Measure = measure
        self.matcher = matcher
        self.residual_px = residual_px
        self.trials = trials
        self.seed = seed
        self.name = f"{features.name}-{measure}"

    @classmethod
    def dense(cls, measure: Measure = "sm2", *, seed: int = 0) -> LocalAffine:
        """Dense Lite0 cells at two scales, residual 28 px: DELF-like, not DELF."""
        return cls(DenseLite0(), measure, seed=seed)

    @classmethod
    def sift(cls, measure: Measure = "sm2", *, seed: int = 0) -> LocalAffine:
        """SIFT with DELF's residual of 20 px."""
        return cls(Sift(), measure, residual_px=20.0, seed=seed)

    @classmethod
    def delf(
        cls,
        measure: Measure = "sm2",
        *,
        seed: int = 0,
        device: str = "cpu",
        reranking: bool = False,
        features: Delf | None = None,
    ) -> LocalAffine:
        """DELF matched as its authors' scripts do, the features of the crop looked up among the render's.

        match_images.py: distance 0.8, residual 20 px. image_reranking.py: 0.9 and 10 px. Both: affine maps
        through three matches, 1000 trials. Pixels are those of the image that DELF sees, which is enlarged.
        The scripts have (row, column); exchanging the two leaves inliers and epsilon as they are.

        Args:
            measure: See :class:`LocalAffine`.
            seed: RANSAC's seed.
            device: ``"cpu"`` or ``"cuda"``.
            reranking: Take the numbers of image_reranking.py.
            features: DELF with other weights or of another side; ``device`` is then not looked at.

        Raises:
            DependencyError: torch or DELF's weights are not there, or torch has no such device.
            InputError: the weights are damaged.
        """
        features = _delf(device) if features is None else features
        matcher, residual = (_near_enough_to_rerank, 10.0) if reranking else (nearest_within, 20.0)
        return cls(
            features,
            measure,
            matcher=matcher,
            residual_px=residual * SIDE / features.side,
            seed=seed,
        )

    @classmethod
    def xfeat(cls, measure: Measure = "sm2", *, seed: int = 0, device: str = "cpu") -> LocalAffine:
        """XFeat with mutual nearest neighbours and SIFT's residual of 20 px.

        Raises:
            DependencyError: its package is not there, or torch has no such device.
        """
        return cls(XFeat(device=device), measure, residual_px=20.0, seed=seed)

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """(N,) scores; see :class:`cadpose.similarity.SimilarityMeasure`. ``aspect`` is not used."""
        return self.compare(crop, mask, views).scores[self.measure]

    def compare(self, crop: NDArray[np.uint8], mask: Mask | None, views: Views) -> AffineComparison:
        """All measures with the matches that they rest on.

        Args:
            crop: (S, S, 3) uint8 letterboxed crop.
            mask: (S, S) bool; only features of the crop within it are used, where given.
            views: Renders; only features within their masks are used.
        """
        photo = self.features.describe(crop[None], None if mask is None else mask[None])[0]
        renders = self.features.describe(views.over(BACKGROUND), views.mask)
        matches = tuple(self._match(photo, render) for render in renders)
        return AffineComparison(matches, _all_measures([m.fit for m in matches]))

    def _match(self, photo: Features, render: Features) -> ViewMatches:
        pairs = self.matcher(photo.descriptors, render.descriptors)
        crop_xy, view_xy = photo.xy[pairs[:, 0]], render.xy[pairs[:, 1]]
        fit = ransac_affine(
            crop_xy, view_xy, residual_px=self.residual_px, trials=self.trials, seed=self.seed
        )
        return ViewMatches(crop_xy, view_xy, fit)


@cache
def _delf(device: str) -> Delf:
    """The authors' DELF, one network in memory however many measures rest on it."""
    return Delf(device=device)


def _near_enough_to_rerank(a: FloatMatrix, b: FloatMatrix) -> Pairs:
    # By name, not a partial: measures that share a matcher share their matches.
    return nearest_within(a, b, max_distance=0.9)


def _all_measures(fits: Sequence[AffineFit]) -> dict[Measure, FloatArray]:
    return {
        "sm1": measures.sm1(fits),
        "sm2": measures.sm2(fits),
        "sm3": measures.sm3(fits),
        "sm1_normalised": measures.sm1_normalised(fits, SIDE),
        "sm3_normalised": measures.sm3_normalised(fits, SIDE),
    }
