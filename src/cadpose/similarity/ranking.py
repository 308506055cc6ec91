"""Candidates in rank order: every CAD model at every rotation in question, the best kept of each."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Candidate, Mask, Rotation, Views
from cadpose.similarity import SimilarityMeasure


def rank_candidates(
    crop: NDArray[np.uint8],
    crop_mask: Mask | None,
    aspect: float,
    cads: Sequence[CadModel],
    rotations: Sequence[Sequence[Rotation]],
    *,
    render: Callable[[CadModel, FloatArray], Views],
    chooser: SimilarityMeasure,
    measure: SimilarityMeasure,
) -> list[Candidate]:
    """Choose each model's rotation with a quick measure, then rank the models with the real one.

    Args:
        crop: (S, S, 3) uint8, the object's box letterboxed.
        crop_mask: (S, S) bool mask of the object, or None.
        aspect: Width / height of the box.
        cads: At least one model.
        rotations: For each model, the rotations at which it is tried.
        render: Draws a model at (N, 3, 3) rotations, framed as the crop is.
        chooser: Compares all models at all rotations in one call and so picks each model's rotation.
        measure: Ranks the models, one render each; may be the chooser itself.

    Returns:
        One candidate a model with its best rotation, best first; equal scores keep the order of ``cads``.

    Raises:
        ValueError: there is no model, or a model has no rotation.
    """
    if not cads or len(rotations) != len(cads) or not all(rotations):
        raise ValueError("ranking needs at least one CAD model and at least one rotation for each")
    views = [
        render(cad, np.stack([rotation.to_matrix() for rotation in tried]))
        for cad, tried in zip(cads, rotations, strict=True)
    ]
    measures: list[dict[str, float]] = [{} for _ in cads]
    best = np.zeros(len(cads), np.int64)
    if chooser is measure or any(len(tried) > 1 for tried in rotations):
        scores = chooser.score(crop, crop_mask, Views.joined(views), aspect=aspect)
        parts = np.split(scores, np.cumsum([len(v) for v in views])[:-1])
        best = np.array([part.argmax() for part in parts], np.int64)
        for told, part, i in zip(measures, parts, best, strict=True):
            told[chooser.name] = float(part[i])
    if chooser is not measure:
        chosen = Views.joined([v.take([int(i)]) for v, i in zip(views, best, strict=True)])
        for told, score in zip(measures, measure.score(crop, crop_mask, chosen, aspect=aspect), strict=True):
            told[measure.name] = float(score)
    final = np.array([told[measure.name] for told in measures])
    return [
        Candidate(cads[i], float(final[i]), rotations[i][best[i]], measures[i])
        for i in np.argsort(-final, kind="stable")
    ]
