from __future__ import annotations

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest

from cadpose import threads
from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.photos import crop_square
from cadpose.records import CadModel, Rotation, RotationHypothesis, Views
from cadpose.similarity.joint import ranker as module
from cadpose.similarity.joint.ranker import JointRanker, JointRanking
from cadpose.similarity.local_features import BACKGROUND
from tests.similarity.joint.made import SmallSource
from tests.small_library import Shot, shoot

TRUE = Rotation(35, 12)


def guesses(*azimuths: float, p: float = 0.8) -> list[RotationHypothesis]:
    return [RotationHypothesis(Rotation(a, 10), 1.0 - i, p) for i, a in enumerate(azimuths)]


@pytest.fixture(scope="module")
def source(small_library: Library) -> SmallSource:
    return SmallSource(small_library)


@pytest.fixture(scope="module")
def rank(source: SmallSource, small_library: Library) -> Callable[..., JointRanking]:
    ranker = JointRanker(source, source.render, seed=1)

    def of(
        shot: Shot, hypotheses: list[RotationHypothesis], cads: list[CadModel], **more: bool
    ) -> JointRanking:
        grey = crop_square(shot.photo.rgb, shot.box, 224, fill=BACKGROUND)
        white = crop_square(shot.photo.rgb, shot.box, 224)
        return ranker.rank(grey, white, shot.box.width / shot.box.height, cads, hypotheses, **more)

    return of


@pytest.mark.parametrize("cad", ["made/car/hatch.obj", "made/car/pickup.obj", "made/car/van.glb"])
def test_model_and_rotation_are_found_from_a_guess_that_is_off(
    small_library: Library, rank: Callable[..., JointRanking], cad: str
) -> None:
    shot = shoot(small_library, cad, TRUE)
    cads = small_library.models("car")
    found = rank(shot, guesses(20), cads)
    first = found.candidates[0]
    assert first.cad.id == cad and {c.cad for c in found.candidates} == set(cads)
    assert first.rotation.error_to(TRUE) < 12.0 < Rotation(20, 10).error_to(TRUE)
    assert {"aligned", "inliers", "cached-aligned", "cached-inliers"} == set(first.measures)
    told = [c.probability for c in found.candidates]
    assert None not in told and sum(p or 0.0 for p in told) + found.none_probability == pytest.approx(1.0)
    scores = [c.score for c in found.candidates]
    assert scores == sorted(scores, reverse=True)


def test_a_later_guess_may_be_the_right_one(
    small_library: Library, rank: Callable[..., JointRanking]
) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    found = rank(shot, guesses(-40, 40), small_library.models("car"))
    assert found.candidates[0].cad.id == "made/car/hatch.obj"
    assert found.candidates[0].rotation.error_to(TRUE) < 12.0


def test_a_known_rotation_is_kept(small_library: Library, rank: Callable[..., JointRanking]) -> None:
    shot = shoot(small_library, "made/car/pickup.obj", TRUE)
    known = [RotationHypothesis(TRUE, 1.0, 1.0)]
    found = rank(shot, known, small_library.models("car"), fixed=True)
    assert [c.rotation for c in found.candidates] == [TRUE] * 3
    assert found.candidates[0].cad.id == "made/car/pickup.obj"


def test_models_that_are_not_drawn_follow(
    small_library: Library, rank: Callable[..., JointRanking], monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = shoot(small_library, "made/car/van.glb", TRUE)
    monkeypatch.setattr(module, "DRAWN", 1)
    found = rank(shot, guesses(35), small_library.models("car"))
    assert ["aligned" in c.measures for c in found.candidates] == [True, False, False]
    scores = [c.score for c in found.candidates]
    assert scores == sorted(scores, reverse=True) and np.isfinite(scores).all()


def test_the_order_of_the_models_makes_no_difference(
    small_library: Library, rank: Callable[..., JointRanking]
) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    cads = list(small_library.models("car"))
    one, two = rank(shot, guesses(30), cads), rank(shot, guesses(30), cads[::-1])
    assert [(c.cad, c.score) for c in one.candidates] == [(c.cad, c.score) for c in two.candidates]


def test_one_model_is_an_answer_too(small_library: Library, rank: Callable[..., JointRanking]) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    (only,) = rank(shot, guesses(30), [small_library.get("made/car/van.glb")]).candidates
    assert only.cad.id == "made/car/van.glb"
    with pytest.raises(ValueError, match="at least one"):
        rank(shot, guesses(30), [])
    with pytest.raises(ValueError, match="hypothesis"):
        rank(shot, [], [only.cad])


@pytest.mark.parametrize("shared", [False, True])
def test_a_renderer_is_called_by_one_thread_at_a_time_unless_it_allows_more(
    small_library: Library, source: SmallSource, monkeypatch: pytest.MonkeyPatch, shared: bool
) -> None:
    monkeypatch.setattr(threads, "_allowed", 2)
    by: set[str] = set()

    def render(cad: CadModel, R_cv_from_s: FloatArray) -> Views:
        by.add(threading.current_thread().name)
        time.sleep(0.02)
        return source.render(cad, R_cv_from_s)

    ranker = JointRanker(source, render, seed=1, shared=shared)
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    grey = crop_square(shot.photo.rgb, shot.box, 224, fill=BACKGROUND)
    cads = small_library.models("car")
    ranker.drawn(grey, 1.0, cads, np.stack([TRUE.to_matrix()] * len(cads)))
    assert (by == {threading.current_thread().name}) is not shared
