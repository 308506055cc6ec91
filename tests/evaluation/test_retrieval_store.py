"""Outcomes on disk: what is read is what was written, and no run goes on with another's."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cadpose.errors import InputError, LibraryError
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.retrieval import Outcome, Rejection
from cadpose.evaluation.retrieval_store import (
    OUTCOMES,
    SETTINGS,
    OutcomeStore,
    outcome_from_json,
    outcome_to_json,
)
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.records import Candidate, Rotation
from tests.evaluation.retrieving import label, rejected

SET: dict[str, Any] = {"seed": 0, "measures": {"one": "fake"}}
NAMES = ("one", "two")


@pytest.fixture
def ranked(small_library: Library) -> Outcome:
    cads = small_library.models("car")
    candidates = tuple(
        Candidate(cad, 3.5 - i, Rotation(12.25 + i, 3, -1.5), {"one": 3.5 - i}) for i, cad in enumerate(cads)
    )
    answers: dict[str, Ranking | Rejection] = {"one": Ranking(candidates, 0.75, False)}
    answers["two"] = Rejection("ranking", "too dark")
    ids = tuple(cad.id for cad in cads)
    return Outcome(label(ids[1]), answers, ids, Box(1, 2, 30.5, 40), Rotation(10, 20, 5), 12.5)


def told(outcome: Outcome) -> dict[str, Any]:
    return outcome_to_json(outcome)


def test_there_and_back(ranked: Outcome, small_library: Library) -> None:
    for outcome in (ranked, replace(ranked, rotation=None, rotation_error=None), rejected(names=NAMES)):
        back = outcome_from_json(told(outcome), outcome.label, small_library)
        assert told(back) == told(outcome) and back.label is outcome.label
        assert (back.box, back.rotation, back.candidates) == (
            outcome.box,
            outcome.rotation,
            outcome.candidates,
        )
    entry = told(ranked)
    assert entry["answers"]["one"]["place"] == 2
    assert entry["answers"]["one"]["ranking"][1] == [ranked.label.cad, 2.5, 13.25, 3.0, -1.5]


def test_a_run_goes_on_where_it_was_killed(ranked: Outcome, small_library: Library, tmp_path: Path) -> None:
    labels = [ranked.label, rejected(names=NAMES).label, ranked.label]
    store = OutcomeStore(tmp_path / "out", SET)
    assert store.read(labels, small_library, NAMES) == {}
    store.append(0, ranked)
    store.append(1, rejected(names=NAMES))
    path = tmp_path / "out" / OUTCOMES
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:40])
    again = OutcomeStore(tmp_path / "out", SET, resume=True)
    known = again.read(labels, small_library, NAMES)
    assert sorted(known) == [0, 1] and told(known[0]) == told(ranked)
    again.append(2, ranked)
    assert sorted(again.read(labels, small_library, NAMES)) == [0, 1, 2]


def test_another_runs_folder_is_refused(tmp_path: Path) -> None:
    OutcomeStore(tmp_path, SET)
    with pytest.raises(InputError, match="holds an evaluation already: add --resume"):
        OutcomeStore(tmp_path, SET)
    with pytest.raises(InputError, match=r"other settings \(seed\)"):
        OutcomeStore(tmp_path, SET | {"seed": 1}, resume=True)
    with pytest.raises(InputError, match=r"other settings \(measures\)"):
        OutcomeStore(tmp_path, {"seed": 0}, resume=True)
    (tmp_path / SETTINGS).write_text("[]")
    with pytest.raises(InputError, match="other settings"):
        OutcomeStore(tmp_path, SET, resume=True)
    (tmp_path / SETTINGS).unlink()
    (tmp_path / OUTCOMES).write_text("")
    with pytest.raises(InputError, match=r"no settings\.json"):
        OutcomeStore(tmp_path, SET, resume=True)


@pytest.mark.parametrize("line", ["[]", "{}", '{"number": 9}', '{"number": "a"}', "3"])
def test_lines_that_are_no_outcomes(line: str, small_library: Library, tmp_path: Path) -> None:
    store = OutcomeStore(tmp_path, SET)
    (tmp_path / OUTCOMES).write_text(line + "\n")
    with pytest.raises(InputError, match=r"outcomes\.jsonl: line 1 is no outcome of these photos"):
        store.read([label()], small_library, NAMES)


def test_outcomes_of_other_photos(ranked: Outcome, small_library: Library, tmp_path: Path) -> None:
    store = OutcomeStore(tmp_path, SET)
    store.append(0, ranked)
    with pytest.raises(InputError, match="line 1"):
        store.read([label("other")], small_library, NAMES)
    entry = told(ranked)
    entry["answers"]["one"]["ranking"][0][0] = "nonsense"
    with pytest.raises(LibraryError, match="nonsense"):
        outcome_from_json(entry, ranked.label, small_library)
    entry["answers"] = {"one": {"rejected": "breakfast", "reason": ""}}
    with pytest.raises(ValueError, match="breakfast"):
        outcome_from_json(entry, ranked.label, small_library)


@pytest.mark.parametrize("number", [-1, True, 1, 0.0])
def test_numbers_of_no_photo(number: object, ranked: Outcome, small_library: Library, tmp_path: Path) -> None:
    store = OutcomeStore(tmp_path, SET)
    (tmp_path / OUTCOMES).write_text(json.dumps({"number": number, **told(ranked)}) + "\n")
    with pytest.raises(InputError, match=r"line 1 is no outcome .*there is no photo number"):
        store.read([ranked.label], small_library, NAMES)


def test_answers_of_others(ranked: Outcome, small_library: Library, tmp_path: Path) -> None:
    store = OutcomeStore(tmp_path, SET)
    store.append(0, ranked)
    for names in (("one",), ("one", "two", "three"), ("one", "three")):
        with pytest.raises(InputError, match=r"line 1 is no outcome .*it has answers of one, two"):
            store.read([ranked.label], small_library, names)


def test_too_many_bytes(
    ranked: Outcome, small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = OutcomeStore(tmp_path, SET)
    store.append(0, ranked)
    monkeypatch.setattr("cadpose.evaluation.retrieval_store.MAX_JSONL_BYTES", 100)
    with pytest.raises(InputError, match=r"outcomes\.jsonl: larger than"):
        store.read([ranked.label], small_library, NAMES)


def test_whether_a_rejection_is_measured_is_kept(small_library: Library) -> None:
    for measured in (True, False):
        one = rejected("detection", measured=measured)
        (answer,) = outcome_from_json(told(one), one.label, small_library).answers.values()
        assert isinstance(answer, Rejection) and answer.measured is measured
