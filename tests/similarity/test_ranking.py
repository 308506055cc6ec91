from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Candidate, Mask, Rotation, Views
from cadpose.similarity.aligned import AlignedCosine
from cadpose.similarity.ranking import rank_candidates
from tests.similarity.shapes import figure, photo_of

CROP = np.zeros((8, 8, 3), np.uint8)
MASK = np.ones((8, 8), np.bool_)
FRONT, SIDE, BACK = Rotation(0.0, 0.0), Rotation(90.0, 0.0), Rotation(180.0, 0.0)
A, B, C = (CadModel(i, i, "car") for i in "abc")


class Drawing:
    """Views whose red tells the model and whose green tells the azimuth."""

    def __init__(self) -> None:
        self.calls: list[tuple[str, int]] = []

    def __call__(self, cad: CadModel, R_cv_from_s: FloatArray) -> Views:
        self.calls.append((cad.id, len(R_cv_from_s)))
        n = len(R_cv_from_s)
        rgb = np.zeros((n, 8, 8, 3), np.uint8)
        rgb[..., 0] = ord(cad.id)
        for i, R in enumerate(R_cv_from_s):
            rgb[i, ..., 1] = round(Rotation.from_matrix(R).azimuth / 2)
        return Views(rgb, np.full((n, 8, 8), 255, np.uint8), np.ones((n, 8, 8), np.float32))


class Told:
    """Scores looked up by model and azimuth; keeps what it was asked."""

    def __init__(self, name: str, score: Callable[[str, float], float]) -> None:
        self.name = name
        self.by = score
        self.seen: list[list[tuple[str, float]]] = []
        self.given: list[tuple[object, object, float | None]] = []

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        shown = [(chr(v[0, 0, 0]), 2.0 * float(v[0, 0, 1])) for v in views.rgb]
        self.seen.append(shown)
        self.given.append((crop, mask, aspect))
        return np.array([self.by(*s) for s in shown])


def rank(
    rotations: list[list[Rotation]],
    chooser: Told,
    measure: Told,
    cads: tuple[CadModel, ...] = (A, B, C),
    render: Drawing | None = None,
) -> list[Candidate]:
    return rank_candidates(
        CROP, MASK, 1.5, cads, rotations, render=render or Drawing(), chooser=chooser, measure=measure
    )


def test_best_first_with_scores_and_rotations() -> None:
    only = Told("m", lambda cad, azimuth: {"a": 0.1, "b": 0.9, "c": 0.5}[cad])
    found = rank([[FRONT], [SIDE], [BACK]], only, only)
    assert [(c.cad, c.score, c.rotation) for c in found] == [(B, 0.9, SIDE), (C, 0.5, BACK), (A, 0.1, FRONT)]
    assert [c.measures for c in found] == [{"m": 0.9}, {"m": 0.5}, {"m": 0.1}]


def test_equal_scores_keep_the_given_order() -> None:
    even = Told("m", lambda cad, azimuth: 1.0 if cad == "b" else 0.0)
    assert [c.cad.id for c in rank([[FRONT]] * 3, even, even)] == ["b", "a", "c"]
    assert [c.cad.id for c in rank([[FRONT]] * 3, even, even, (C, A, B))] == ["b", "c", "a"]


def test_chooser_picks_the_rotation_and_measure_the_model() -> None:
    chooser = Told("quick", lambda cad, azimuth: azimuth if cad != "b" else -azimuth)
    measure = Told("real", lambda cad, azimuth: {"a": 1.0, "b": 3.0, "c": 2.0}[cad])
    found = rank([[FRONT, SIDE, BACK], [FRONT, SIDE], [SIDE]], chooser, measure)
    assert [(c.cad, c.rotation) for c in found] == [(B, FRONT), (C, SIDE), (A, BACK)]
    assert [c.score for c in found] == [3.0, 2.0, 1.0]
    assert [c.measures for c in found] == [
        {"quick": 0.0, "real": 3.0},
        {"quick": 90.0, "real": 2.0},
        {"quick": 180.0, "real": 1.0},
    ]
    # All models at all rotations at once, then one render a model, in the given order.
    assert chooser.seen == [[("a", 0), ("a", 90), ("a", 180), ("b", 0), ("b", 90), ("c", 90)]]
    assert measure.seen == [[("a", 180), ("b", 0), ("c", 90)]]


def test_the_measure_itself_may_choose() -> None:
    only = Told("m", lambda cad, azimuth: -abs(azimuth - 90.0) - (cad == "a"))
    found = rank([[FRONT, SIDE], [BACK, SIDE], [FRONT]], only, only)
    assert [(c.cad, c.rotation, c.score) for c in found] == [(B, SIDE, 0), (A, SIDE, -1), (C, FRONT, -90)]
    assert len(only.seen) == 1


def test_equally_good_rotations_keep_the_first() -> None:
    even = Told("m", lambda cad, azimuth: 0.0)
    assert [c.rotation for c in rank([[SIDE, FRONT], [BACK, SIDE], [FRONT]], even, even)] == [
        SIDE,
        BACK,
        FRONT,
    ]


def test_where_nothing_is_to_be_chosen_the_chooser_rests() -> None:
    chooser, measure = Told("quick", lambda *_: 0.0), Told("real", lambda cad, _: float(ord(cad)))
    found = rank([[FRONT], [FRONT], [SIDE]], chooser, measure)
    assert chooser.seen == []
    assert [c.cad for c in found] == [C, B, A]
    assert set(found[0].measures) == {"real"}


def test_crop_mask_and_aspect_reach_both() -> None:
    chooser, measure = Told("quick", lambda *_: 0.0), Told("real", lambda *_: 0.0)
    rank([[FRONT, SIDE], [FRONT], [FRONT]], chooser, measure)
    for crop, mask, aspect in (*chooser.given, *measure.given):
        assert crop is CROP
        assert mask is MASK
        assert aspect == 1.5


def test_each_model_is_drawn_once_at_its_rotations() -> None:
    render, only = Drawing(), Told("m", lambda *_: 0.0)
    rank([[FRONT, SIDE, BACK], [FRONT], [SIDE, BACK]], only, only, render=render)
    assert render.calls == [("a", 3), ("b", 1), ("c", 2)]


@pytest.mark.parametrize(
    ("cads", "rotations"), [((), []), ((A,), [[]]), ((A, B), [[FRONT], []]), ((A, B), [[FRONT]])]
)
def test_without_a_model_or_a_rotation_there_is_no_ranking(
    cads: tuple[CadModel, ...], rotations: list[list[Rotation]]
) -> None:
    only = Told("m", lambda *_: 0.0)
    with pytest.raises(ValueError, match="at least one CAD model and at least one rotation"):
        rank(rotations, only, only, cads)
    assert only.seen == []


def test_the_default_measure_finds_the_drawn_figure() -> None:
    def render(cad: CadModel, R_cv_from_s: FloatArray) -> Views:
        rgb, alpha = figure(int(cad.id))
        n = len(R_cv_from_s)
        depth = np.where(alpha > 0, 2.0, np.inf).astype(np.float32)
        return Views(np.stack([rgb] * n), np.stack([alpha] * n), np.stack([depth] * n))

    cads = [CadModel(str(k), "figure", "car") for k in range(5)]
    aligned = AlignedCosine()
    for kind in (0, 3):
        found = rank_candidates(
            photo_of(kind), None, 1.4, cads, [[FRONT]] * 5, render=render, chooser=aligned, measure=aligned
        )
        assert found[0].cad.id == str(kind)
