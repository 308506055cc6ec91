"""Retrieval on labelled photos at their true rotation: the places that Table 4 counts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from cadpose.evaluation.statistics import wilson_interval
from cadpose.library.catalogue import Library
from cadpose.records import CadModel
from cadpose.training.triplet.data import Example, Pictures, shown
from cadpose.training.triplet.loss import distances
from cadpose.training.triplet.network import TwoEncoders

#: Models that are compared with a photo, the true one among them.
CANDIDATES = 10


def candidates(library: Library, cad: CadModel) -> list[CadModel]:
    """The model itself, then the representatives of its category, without those of the same mesh."""
    pool = library.representatives(cad.category, CANDIDATES)
    return [cad, *(m for m in pool if m.sha256 != cad.sha256)][:CANDIDATES]


@torch.no_grad()
def validate(
    network: TwoEncoders, examples: Sequence[Example], pictures: Pictures, workers: int = 0
) -> dict[str, Any]:
    """How often the true model is the nearest, among the nearest two and three, by class and overall.

    A model as near as the true one counts as nearer, so that a network that answers everything alike is
    not taken for a good one.

    Returns:
        ``n`` photos, and as shares of them ``top1``, ``top2`` and ``top3`` with Wilson 95 % intervals, and
        ``chance``, what guessing would give for ``top1``; the same by category under ``classes``.
    """
    network.eval()
    device = next(network.parameters()).device
    models = pictures.library.models()
    number = {model.id: i for i, model in enumerate(models)}
    pools = [candidates(pictures.library, example.cad) for example in examples]
    others = [[number[cad.id] for cad in pool[1:]] for pool in pools]
    places: list[_Place] = []
    for seen in shown(examples, range(len(examples)), others, models, pictures, workers):
        images = (torch.from_numpy(x).to(device) for x in (seen.photo, seen.renders))
        apart = distances(*network(*images)).double().cpu().numpy()
        rank = 1 + int(np.count_nonzero(apart[1:] <= apart[0]))
        places.append(_Place(examples[seen.index].cad.category, rank, len(apart)))
    categories = sorted({place.category for place in places})
    classes = {name: _row([p for p in places if p.category == name]) for name in categories}
    return {**_row(places), "classes": classes}


@dataclass(frozen=True, slots=True)
class _Place:
    category: str
    rank: int
    candidates: int


def _row(places: Sequence[_Place]) -> dict[str, Any]:
    n = len(places)
    row: dict[str, Any] = {"n": n, "chance": float(np.mean([1.0 / place.candidates for place in places]))}
    for k in (1, 2, 3):
        hits = sum(place.rank <= k for place in places)
        row[f"top{k}"] = hits / n
        row[f"top{k}_interval"] = list(wilson_interval(hits, n))
    return row
