"""The similarity measures by name."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import get_args

from cadpose.encoder import Lite0
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.fused import Fused
from cadpose.similarity.local_affine import LocalAffine, Measure
from cadpose.similarity.local_features import DenseLite0
from cadpose.similarity.triplet import TripletMeasure


def measures(encoder: Lite0, seed: int) -> dict[str, Callable[[], SimilarityMeasure]]:
    """Name to maker: ``aligned`` compares maps, ``fused`` is slower and better, the others are the paper's.

    The default is none of them but the joint ranking, :mod:`cadpose.similarity.joint`.

    ``triplet``, its learned baseline, needs a network of one's own. Those of ``delf-`` need torch and DELF's
    weights, those of ``xfeat-`` an extra; their makers say so where it is missing.
    """
    table: dict[str, Callable[[], SimilarityMeasure]] = {
        "aligned": partial(AlignedCosine, encoder),
        "fused": partial(Fused, encoder, seed),
    }
    for measure in get_args(Measure):
        table[measure] = partial(LocalAffine, DenseLite0(encoder=encoder), measure, seed=seed)
        table[f"sift-{measure}"] = partial(LocalAffine.sift, measure, seed=seed)
        table[f"delf-{measure}"] = _on(encoder, LocalAffine.delf, measure, seed)
        table[f"xfeat-{measure}"] = _on(encoder, LocalAffine.xfeat, measure, seed)
    table["triplet"] = lambda: TripletMeasure(device=encoder.device)
    return table


def _on(
    encoder: Lite0, make: Callable[..., SimilarityMeasure], measure: Measure, seed: int
) -> Callable[[], SimilarityMeasure]:
    """A maker of a measure that runs where the encoder does."""
    return lambda: make(measure, seed=seed, device=encoder.device)
