"""CAD retrieval over a label file: how often the true model is first, second or third (Tables 1-3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from cadpose.datasets.labels import Label, object_in_photo
from cadpose.errors import InputError
from cadpose.evaluation.statistics import macro_mean, wilson_interval
from cadpose.pipeline import Annotator
from cadpose.records import CadModel

RotationFrom = Literal["true", "estimated"]


@dataclass(frozen=True, slots=True)
class RetrievalResult:
    """One photo's outcome.

    Attributes:
        label: What is true.
        ranking: CAD ids, best first; empty where the photo failed.
        rank: 1-based rank of the true model, None if it was not ranked.
        reason: Why the photo failed.
    """

    label: Label
    ranking: tuple[str, ...]
    rank: int | None
    reason: str = ""


def retrieval_ranking(
    annotator: Annotator, gallery: Sequence[str] | None, rotation_from: RotationFrom
) -> Callable[[Label], list[str]]:
    """What ranks CAD models for a label: the annotator, over a gallery, at a rotation.

    Args:
        annotator: Compares; estimates the rotation too where that is wanted.
        gallery: Library ids, those of the label's category are the choice; None for the category's
            representatives.
        rotation_from: Compare at the labelled (``"true"``) or at the ``"estimated"`` rotation.

    Returns:
        From a label to CAD ids, best first. It raises CadposeError where the photo cannot be used, there
        is no model of the category, or the label lacks its rotation.

    Raises:
        LibraryError: the library lacks a model of the gallery.
    """
    chosen = None if gallery is None else [annotator.library.get(cad) for cad in gallery]

    def rank(label: Label) -> list[str]:
        photo, box = object_in_photo(label)
        cads: Sequence[CadModel]
        if chosen is None:
            cads = annotator.library.representatives(label.category, annotator.candidate_count)
        else:
            cads = [cad for cad in chosen if cad.category == label.category]
        if not cads:
            raise InputError(f"{label.photo}: the gallery has no CAD model of category {label.category!r}")
        if rotation_from == "estimated":
            rotation = annotator.estimate_rotation(photo, box, label.category, cads)[0].rotation
        elif label.rotation is not None:
            rotation = label.rotation
        else:
            raise InputError(f"{label.photo}: has no labelled rotation, use --rotation estimated")
        return [candidate.cad.id for candidate in annotator.rank(photo, box, cads, [rotation])]

    return rank


def evaluate_retrieval(
    labels: Sequence[Label],
    rank: Callable[[Label], Sequence[str]],
    recoverable: type[Exception],
    on_done: Callable[[RetrievalResult], None] = lambda _: None,
) -> list[RetrievalResult]:
    """Run ``rank`` over the labels that name a CAD; a ``recoverable`` error fails that photo only."""
    results = []
    for label in labels:
        try:
            ranking = tuple(rank(label))
            place = ranking.index(label.cad) + 1 if label.cad in ranking else None
            result = RetrievalResult(label, ranking, place)
        except recoverable as error:
            result = RetrievalResult(label, (), None, str(error))
        results.append(result)
        on_done(result)
    return results


def retrieval_table(results: Sequence[RetrievalResult]) -> dict[str, Any]:
    """``top1``, ``top2``, ``top3`` as fractions of 1 over the photos that gave a ranking.

    With a Wilson 95 % interval each, a row a class under ``classes`` and their macro mean. Where no photo
    gave a ranking, all but ``n`` and ``yield`` are None.
    """
    classes = sorted({r.label.category for r in results})
    rows = {c: _row([r for r in results if r.label.category == c]) for c in classes}
    table: dict[str, Any] = _row(results)
    table["classes"] = rows
    answered = [row for row in rows.values() if row["n"] > 0]
    table["macro"] = macro_mean(answered, ("top1", "top2", "top3")) if answered else {}
    return table


def _row(results: Sequence[RetrievalResult]) -> dict[str, Any]:
    answered = [r for r in results if r.ranking]
    n = len(answered)
    row: dict[str, Any] = {"n": n, "yield": n / len(results) if results else 0.0}
    for k in (1, 2, 3):
        hits = sum(r.rank is not None and r.rank <= k for r in answered)
        row[f"top{k}"] = hits / n if n else None
        row[f"top{k}_interval"] = list(wilson_interval(hits, n)) if n else None
    return row
