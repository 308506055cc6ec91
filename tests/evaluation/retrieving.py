"""Made-up labels, candidates and outcomes for the tests of the retrieval evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cadpose.datasets.labels import Label
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.retrieval import Outcome, Rejection, Stage
from cadpose.geometry.boxes import Box
from cadpose.records import CadModel, Candidate, Rotation

TURN = Rotation(30.0, 5.0)
FIVE = ("a", "b", "c", "d", "e")


def label(cad: str = "a", category: str = "car", *, name: str = "", synthetic: bool = False) -> Label:
    return Label(Path("photos") / (name or f"{cad}.png"), category, cad=cad, synthetic=synthetic)


def ranking(
    ids: Sequence[str],
    category: str = "car",
    *,
    probability: float | None = None,
    needs_review: bool | None = None,
    lead: float = 1.0,
) -> Ranking:
    """The models in that order; ``lead`` is the first one's lead over the second in score."""
    scores = [10.0 + lead, *(10.0 - i for i in range(len(ids) - 1))]
    models = [CadModel(i, f"Model {i}", category) for i in ids]
    candidates = tuple(Candidate(cad, score, TURN) for cad, score in zip(models, scores, strict=False))
    return Ranking(candidates, probability, needs_review)


def outcome(
    place: int | None,
    category: str = "car",
    *,
    cad: str = "a",
    names: Sequence[str] = ("one",),
    probability: float | None = None,
    needs_review: bool | None = None,
    lead: float = 1.0,
    error: float | None = None,
    photo: str = "",
) -> Outcome:
    """The true model at a place of five; None for a true model that is not among the candidates."""
    ids = [i for i in FIVE if i != cad]
    if place is not None:
        ids.insert(place - 1, cad)
    answer = ranking(ids, category, probability=probability, needs_review=needs_review, lead=lead)
    one = label(cad, category, name=photo)
    answers = dict.fromkeys(names, answer)
    return Outcome(one, answers, tuple(sorted(ids)), Box(1, 2, 30, 40), TURN, error)


def rejected(
    stage: Stage = "detection",
    reason: str = "nothing found",
    category: str = "car",
    names: Sequence[str] = ("one",),
    *,
    measured: bool | None = None,
) -> Outcome:
    """By its stage a measured outcome or a failure, unless told."""
    if measured is None:
        measured = stage in ("detection", "review")
    return Outcome(label("a", category), dict.fromkeys(names, Rejection(stage, reason, measured)))
