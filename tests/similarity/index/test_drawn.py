from __future__ import annotations

from dataclasses import replace

import pytest

from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from cadpose.similarity.index.drawn import DrawnRanking
from cadpose.similarity.index.library_index import Match
from tests.small_library import shoot


def matches(library: Library, *, last: str) -> list[Match]:
    """All cars, one of them last."""
    ids = sorted((m.id for m in library.models("car")), key=lambda cad: cad == last)
    return [Match(cad, "car", 2.0 - i, 0.5, Rotation(0.0, 0.0)) for i, cad in enumerate(ids)]


def test_the_photographed_model_comes_first(small_library: Library) -> None:
    ranking = DrawnRanking(small_library)
    for model in small_library.models("car"):
        shot = shoot(small_library, model.id, Rotation(40.0, 12.0))
        found = matches(small_library, last=model.id)
        again = ranking.rank(found, shot.photo.rgb, shot.box, [shot.rotation])
        assert again[0].cad == model.id and again[0].rotation == shot.rotation
        assert {m.cad for m in again} == {m.cad for m in found}
        several = [Rotation(220.0, 12.0), shot.rotation]
        again = ranking.rank(found, shot.photo.rgb, shot.box, several)
        assert again[0].cad == model.id and again[0].rotation == shot.rotation


def test_what_is_not_drawn_stays_behind(small_library: Library) -> None:
    model = small_library.models("car")[0]
    shot = shoot(small_library, model.id, Rotation(40.0, 12.0))
    found = matches(small_library, last=model.id)
    again = DrawnRanking(small_library).rank(found, shot.photo.rgb, shot.box, [shot.rotation], 2)
    assert again[2] == found[2] and {m.cad for m in again[:2]} == {m.cad for m in found[:2]}
    assert [m.score for m in again] == sorted((m.score for m in again), reverse=True)
    assert DrawnRanking(small_library).rank(found, shot.photo.rgb, shot.box, []) == found


def test_a_model_that_has_left_is_passed_over(
    small_library: Library, caplog: pytest.LogCaptureFixture
) -> None:
    model = small_library.models("car")[0]
    shot = shoot(small_library, model.id, Rotation(40.0, 12.0))
    gone = [Match("gone", "car", 3.0, 0.5, Rotation(0.0, 0.0))]
    found = matches(small_library, last=model.id)
    ranking = DrawnRanking(small_library)
    again = ranking.rank([*gone, *found], shot.photo.rgb, shot.box, [shot.rotation])
    assert again == ranking.rank(found, shot.photo.rgb, shot.box, [shot.rotation])
    assert "gone is passed over" in caplog.text
    assert ranking.rank(gone, shot.photo.rgb, shot.box, [shot.rotation]) == []


def test_scores_are_lifted_above_a_rest_only(small_library: Library) -> None:
    model = small_library.models("car")[0]
    shot = shoot(small_library, model.id, Rotation(40.0, 12.0))
    opposed = [replace(match, cosine=-5.0) for match in matches(small_library, last=model.id)]
    again = DrawnRanking(small_library).rank(opposed, shot.photo.rgb, shot.box, [shot.rotation])
    assert len(again) == 3 and all(match.score < -3.0 for match in again)
