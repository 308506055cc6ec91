"""Who ranks the candidates: similarity measures at one rotation, and rankers that see to it themselves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.backends import Backends, encoder_on
from cadpose.errors import CadposeError, DependencyError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.photos import crop_square
from cadpose.pipeline import SIDE, Annotator
from cadpose.records import CadModel, Candidate, Mask, Photo, Rotation, Views
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.fused import Fused
from cadpose.similarity.joint.ranker import JointRanker
from cadpose.similarity.local_affine import AffineComparison, LocalAffine
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.registry import measures as registered

#: What `make_contest` takes for every measure that can be had here.
ALL = "all"


@dataclass(frozen=True, eq=False)
class Ranking:
    """Candidates in order, and what the ranker says of its own answer.

    Attributes:
        candidates: Best first, each with the rotation that it was seen at; at least one.
        probability: Chance that the first one is the true model, in [0, 1]; None if the ranker tells none.
        needs_review: Whether a person should look first; None leaves it to a threshold of the probability.

    Raises:
        ValueError: there is no candidate, one occurs twice, or the probability is outside [0, 1].
    """

    candidates: tuple[Candidate, ...]
    probability: float | None = None
    needs_review: bool | None = None

    def __post_init__(self) -> None:
        ids = [candidate.cad.id for candidate in self.candidates]
        if not ids or len(set(ids)) < len(ids):
            raise ValueError(f"a ranking needs at least one candidate, each once, got {ids}")
        if self.probability is not None and not 0.0 <= self.probability <= 1.0 + 1e-9:
            raise ValueError(f"probability {self.probability} is outside [0, 1]")

    def place(self, cad: str | None) -> int | None:
        """1-based place of a model; None where it is not ranked."""
        for place, candidate in enumerate(self.candidates, 1):
            if candidate.cad.id == cad:
                return place
        return None

    def accepted(self, threshold: float) -> bool | None:
        """Whether the first candidate is taken without a look; None where no probability is stated."""
        if self.probability is None:
            return None
        return self.probability >= threshold if self.needs_review is None else not self.needs_review


class Ranker(Protocol):
    """Ranks candidates from photo and box alone: the rotation is its own affair."""

    name: str

    def rank(self, photo: Photo, box: Box, category: str, candidates: Sequence[CadModel]) -> Ranking:
        """All candidates, best first.

        Args:
            photo: The photo.
            box: The object's box, inside the photo.
            category: Its library category.
            candidates: At least one, in an order that says nothing.

        Raises:
            CadposeError: this photo cannot be ranked.
        """
        ...


class Joint:
    """The default of the pipeline: the estimator's hypotheses, and what they make likely."""

    name = JointRanker.name

    def __init__(self, annotator: Annotator) -> None:
        self.annotator = annotator

    def rank(self, photo: Photo, box: Box, category: str, candidates: Sequence[CadModel]) -> Ranking:
        """See :class:`Ranker`."""
        hypotheses = self.annotator.estimate_rotation(photo, box, category, candidates)
        found = self.annotator.rank_jointly(photo, box, candidates, hypotheses)
        return Ranking(found.candidates, found.candidates[0].probability, found.needs_review)


#: Rankers by name, beside the measures of `cadpose.similarity.registry`; made for one annotator. Whoever runs
#: an evaluation from Python adds their own.
RANKERS: dict[str, Callable[[Annotator], Ranker]] = {Joint.name: Joint}


@dataclass(frozen=True)
class Contest:
    """What is compared with one another.

    Attributes:
        measures: Measures by name; all are shown the same renders, at one rotation.
        rankers: Rankers by name.

    Raises:
        ValueError: nothing is named, or a name stands for both.
    """

    measures: Mapping[str, SimilarityMeasure] = field(default_factory=lambda: MappingProxyType({}))
    rankers: Mapping[str, Ranker] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        if not self.names or len(set(self.names)) < len(self.names):
            raise ValueError(f"a contest needs at least one name, each once, got {self.names}")

    @property
    def names(self) -> tuple[str, ...]:
        """Everything that ranks, measures first."""
        return (*self.measures, *self.rankers)

    @property
    def uses_masks(self) -> bool:
        """Whether a measure looks at the object's mask; to the quick ones it makes no difference."""
        return any(type(measure) not in (AlignedCosine, Fused) for measure in self.measures.values())

    def at_rotation(
        self,
        annotator: Annotator,
        photo: Photo,
        box: Box,
        cads: Sequence[CadModel],
        rotation: Rotation,
        mask: Mask | None = None,
    ) -> dict[str, Ranking]:
        """What each measure makes of the models drawn at a rotation, as the pipeline would.

        Args:
            annotator: Draws, and finds the mask where a measure uses one and none is given.
            photo: The photo.
            box: The object's box, inside the photo.
            cads: The models.
            rotation: How all are turned.
            mask: (H, W) bool mask of the object, None where it is not known.

        Raises:
            CadposeError: a model cannot be drawn, or no mask be found.
        """
        if mask is None and self.uses_masks:
            mask = annotator.masks.mask(photo, box)
        R = rotation.to_matrix()[None]
        views = Views.joined([annotator.render_framed(cad, R) for cad in cads])
        crop = crop_square(photo.rgb, box, SIDE, fill=BACKGROUND)
        crop_mask = None if mask is None else crop_square(mask, box, SIDE)
        scores = scores_together(self.measures, crop, crop_mask, views, box.width / box.height)
        return {
            name: Ranking(
                tuple(
                    Candidate(cads[i], float(some[i]), rotation, {name: float(some[i])})
                    for i in np.argsort(-some, kind="stable")
                )
            )
            for name, some in scores.items()
        }


def make_contest(
    annotator: Annotator,
    names: Sequence[str],
    device: str = "cpu",
    seed: int = 0,
    left_out: Callable[[str], None] = lambda reason: None,
) -> Contest:
    """Measures and rankers by name.

    Args:
        annotator: Draws; a ranker may use its library and estimator.
        names: Names of `known_names`; `ALL` stands for every one that can be made.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds measures that draw random numbers.
        left_out: Told why measures of `ALL` are missing, those of one reason together.

    Raises:
        CadposeError: a name is not known, or nothing can be made.
        DependencyError: what a measure named outright needs is not there.
    """
    known = known_names()
    for name in names:
        if name != ALL and name not in known:
            raise CadposeError(f"unknown measure {name!r}, choose one of: {', '.join((*known, ALL))}")
    backends = Backends(device, seed, None, annotator.render_framed)
    measures, rankers = {}, {}
    missing: dict[str, list[str]] = {}
    for name in dict.fromkeys(n for named in names for n in (known if named == ALL else (named,))):
        try:
            if name in RANKERS:
                rankers[name] = RANKERS[name](annotator)
            else:
                measures[name] = backends.similarity(name)
        except DependencyError as error:
            if name in names:
                raise
            missing.setdefault(str(error), []).append(name)
    for reason, some in missing.items():
        left_out(f"left out: {', '.join(some)}: {reason}")
    return Contest(measures, rankers)


def known_names() -> tuple[str, ...]:
    """Names of all measures, then of all rankers."""
    return (*registered(encoder_on("cpu"), 0), *RANKERS)


def scores_together(
    measures: Mapping[str, SimilarityMeasure],
    crop: NDArray[np.uint8],
    mask: Mask | None,
    views: Views,
    aspect: float,
) -> dict[str, FloatArray]:
    """(N,) scores of N renders by each measure; those that rest on the same matches share them.

    Args:
        measures: By name.
        crop: (S, S, 3) uint8 letterboxed crop.
        mask: (S, S) bool mask of the object in the crop, or None.
        views: N renders.
        aspect: Width / height of the box.
    """
    shared: dict[tuple[object, ...], AffineComparison] = {}

    def matches(local: LocalAffine, mask: Mask | None) -> AffineComparison:
        own = (local.features.name, local.residual_px, local.trials, local.seed, local.matcher)
        key = (*own, mask is None)
        if key not in shared:
            shared[key] = local.compare(crop, mask, views)
        return shared[key]

    scores: dict[str, FloatArray] = {}
    for name, measure in measures.items():
        if type(measure) is LocalAffine:
            scores[name] = matches(measure, mask).scores[measure.measure]
        elif type(measure) is Fused:
            aligned = measure.aligned.score(crop, mask, views, aspect=aspect)
            scores[name] = measure.combine(
                aligned, matches(measure.local, None).scores["sm2"]
            )  # without, as it does alone
        else:
            scores[name] = measure.score(crop, mask, views, aspect=aspect)
    return scores
