"""Decisions: written at once, with their measures, and never over another's."""

from __future__ import annotations

import threading
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from cadpose.annotations.document import document_from
from cadpose.library.catalogue import Library
from cadpose.poses import Rotation
from cadpose.review.answers import AnnotationAnswer, DecisionAnswer
from cadpose.rle import encode_mask, text_from_runs
from tests.annotations.formats.made import Made
from tests.postgres_server import NewDatabase
from tests.review.serving import Served, serve


def detail(served: Served, key: str) -> AnnotationAnswer:
    return AnnotationAnswer.model_validate(served.get(f"/api/annotations/{key}"))


def decide(served: Served, key: str, status: int = 200, **body: Any) -> Any:
    told = {"verdict": "accept", "version": 1, "author": "Bea"} | body
    return served.post(f"/api/annotations/{key}/decisions", told, status)


def with_mask(served: Served) -> str:
    return next(key for key in served.ids() if served.desk.stored(key).annotation.detection.mask is not None)


def test_accept(served: Served) -> None:
    key = served.ids()[1]
    answer = DecisionAnswer.model_validate(decide(served, key, note="good"))
    assert answer.version == answer.item.version == 2
    assert (answer.item.verdict, answer.item.decided_by, answer.item.edited) == ("accept", "human", False)
    told = detail(served, key)
    last = told.history[-1]
    assert (last.author, last.kind, last.verdict, last.note, last.changed) == (
        "Bea", "human", "accept", "good", [],
    )  # fmt: skip
    (decision,) = (d for d in served.desk.store.history(key) if d.author.kind == "human")
    assert decision.author.tool == "cadpose review" and decision.author.tool_version
    assert last.at == decision.decided_at.isoformat() and last.at.endswith("+00:00")


def test_reject_with_a_reason_review_and_skip(served: Served) -> None:
    key = served.ids()[0]
    decide(served, key, verdict="reject", reason="wrong model")
    assert detail(served, key).history[-1].reason == "wrong model"
    decide(served, key, verdict="review", version=2)
    answer = decide(served, key, verdict="skip", version=3, author="")
    assert answer["item"]["verdict"] == "review"
    assert detail(served, key).history[-1].author == "Ada"


def test_an_edit_is_measured(served: Served) -> None:
    key = with_mask(served)
    before = detail(served, key)
    pose = before.pose.model_dump() | {"azimuth": 40.0, "focal_px": before.pose.focal_px * 1.1}
    answer = decide(served, key, verdict="edit", pose=pose)
    assert answer["item"]["edited"] and answer["item"]["verdict"] == "edit"
    after = detail(served, key)
    assert after.pose.azimuth == 40.0 and after.machine.pose == before.pose
    assert after.history[-1].changed == ["pose"]
    measures = served.desk.store.history(key)[-1].measures
    assert after.box_iou == measures["box_iou"] and after.mask_iou == measures["mask_iou"]
    assert 0.0 < measures["mask_iou"] < 1.0 and after.candidates == before.candidates


def test_another_model(served: Served) -> None:
    key = served.ids()[1]
    before = detail(served, key)
    cad = next(m for m in served.desk.models.opened().models("chair") if m.id != before.cad.id)
    decide(served, key, verdict="edit", cad_id=cad.id)
    after = detail(served, key)
    assert after.cad.id == cad.id and after.cad.available and after.machine.cad == before.cad
    assert after.history[-1].changed == ["cad"] and after.pose == before.pose


def test_a_drawn_region(served: Served) -> None:
    key = with_mask(served)
    before = detail(served, key)
    mask = np.zeros((before.photo.height, before.photo.width), np.bool_)
    mask[5:30, 7:40] = True
    rle = {"size": list(mask.shape), "counts": text_from_runs(encode_mask(mask))}
    decide(served, key, verdict="edit", region={"box": [-3.0, 5.0, 40.0, 30.0], "mask": rle})
    after = detail(served, key)
    assert after.detection.box == (0.0, 5.0, 40.0, 30.0) and after.history[-1].changed == ["region"]
    assert after.detection.mask is not None and after.detection.mask.counts == rle["counts"]
    drawn = served.desk.stored(key).annotation
    assert drawn.detection.mask is not None and (drawn.detection.mask == mask).all()
    # The machine's pose, measured anew on what was drawn.
    assert after.mask_iou != before.mask_iou
    decide(served, key, verdict="edit", version=2, region={"box": [1.0, 5.0, 40.0, 30.0], "mask": None})
    assert detail(served, key).detection.mask is None


def test_somebody_was_first(served: Served) -> None:
    key = served.ids()[0]
    decide(served, key, author="Bea")
    told = decide(served, key, 409, verdict="reject", author="Cyd")
    assert told["kind"] == "conflict" and "Bea" in told["error"]
    assert told["current"] == {"version": 2, "in_force": True, "verdict": "accept", "by": "Bea"}
    assert detail(served, key).verdict == "accept"
    assert decide(served, key, 409, version=7)["current"]["version"] == 2
    decide(served, key, verdict="reject", author="Cyd", version=2)
    assert detail(served, key).verdict == "reject"


def run_again(served: Served, key: str) -> None:
    """Another run finds the objects of that photo, each turned the other way."""
    found = served.desk.stored(key)
    photo = served.desk.photo(found.item.photo_sha256, found.item.photo_name)
    document = served.desk.store.document(photo.sha256, original=True)
    assert document is not None
    turned = [
        replace(one, pose=replace(one.pose, rotation=Rotation(one.pose.rotation.azimuth + 120.0, 8.0)))
        for one in document.to_annotations()
    ]
    served.desk.store.add(document_from(replace(photo, name=found.item.photo_name), turned))


def test_another_run_took_its_place(served: Served) -> None:
    key = served.ids()[0]
    run_again(served, key)
    told = decide(served, key, 409)
    assert told["current"]["in_force"] is False and "load the photo again" in told["error"]
    assert decide(served, key, 409, version=told["current"]["version"])["current"] == told["current"]


def test_another_run_comes_right_behind(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """The decision was stored, so it is answered as such."""
    key, store = served.ids()[0], served.desk.store
    storing = store.decide

    def followed(*arguments: Any, **words: Any) -> int:
        version = storing(*arguments, **words)
        run_again(served, key)
        return version

    monkeypatch.setattr(store, "decide", followed)
    answer = decide(served, key, verdict="review")
    assert answer["version"] == 2 and answer["item"]["id"] == key
    assert not detail(served, key).in_force and detail(served, key).history[-1].verdict == "review"


REQUEST = "0123456789abcdef" * 2


def test_the_same_request_again_gets_the_same_answer(served: Served) -> None:
    key, other = served.ids()[:2]
    first = decide(served, key, request_id=REQUEST)
    assert decide(served, key, request_id=REQUEST) == first
    # Also after somebody else's word, since it is the answer of then; and it is stored once.
    decide(served, key, verdict="reject", version=2, author="Cyd")
    assert decide(served, key, request_id=REQUEST) == first
    assert [d.verdict for d in detail(served, key).history if d.kind == "human"] == ["accept", "reject"]
    # Another request, and the same name at another annotation, are told apart.
    assert decide(served, key, 409, request_id=REQUEST[::-1])["kind"] == "conflict"
    assert decide(served, key, 409)["kind"] == "conflict"
    assert decide(served, other, request_id=REQUEST)["item"]["id"] == other


def test_a_refused_request_is_not_remembered(served: Served) -> None:
    key = served.ids()[0]
    decide(served, key, 409, version=7, request_id=REQUEST)
    decide(served, key, 422, verdict="edit", request_id=REQUEST)
    assert decide(served, key, request_id=REQUEST)["version"] == 2


def test_the_same_request_while_the_first_is_stored(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    key, store = served.ids()[0], served.desk.store
    storing, stored, go_on = store.decide, threading.Event(), threading.Event()

    def held(*arguments: Any, **words: Any) -> int:
        version = storing(*arguments, **words)
        stored.set()
        go_on.wait(10)
        return version

    monkeypatch.setattr(store, "decide", held)
    # One event loop for both, as in a server.
    with served.client, ThreadPoolExecutor(2) as pool:
        first = pool.submit(decide, served, key, request_id=REQUEST)
        assert stored.wait(10)
        second = pool.submit(decide, served, key, request_id=REQUEST)
        time.sleep(0.3)
        assert not second.done()
        go_on.set()
        assert first.result(10) == second.result(10)


def test_without_a_library_an_edit_is_not_measured(tmp_path: Any, made: Made) -> None:
    served = serve(tmp_path, None, made)
    try:
        key = with_mask(served)
        before = detail(served, key)
        assert not before.cad.available and served.get("/api/session")["library"] is None
        assert not served.get("/api/session")["actions"]["snap"]
        decide(served, key, verdict="edit", pose=before.pose.model_dump() | {"azimuth": 1.0})
        after = detail(served, key)
        assert after.mask_iou is None and after.pose.azimuth == 1.0
        cad = made.library.models()[0].id
        assert "no CAD library" in decide(served, key, 422, verdict="edit", version=2, cad_id=cad)["error"]
    finally:
        served.close()


def test_on_a_server(tmp_path: Any, small_library: Library, made: Made, new_postgres: NewDatabase) -> None:
    served = serve(tmp_path, small_library, made, url=new_postgres())
    try:
        key = served.ids()[1]
        pose = detail(served, key).pose.model_dump() | {"azimuth": 40.0}
        decide(served, key, verdict="edit", pose=pose)
        assert decide(served, key, 409)["current"]["by"] == "Bea"
        assert detail(served, key).pose.azimuth == 40.0
        assert served.get("/api/queue?verdict=edit")["total"] == served.get("/api/stats")["decided"] == 1
        assert served.client.get("/api/export/coco").status_code == 200
        assert "password" not in served.get("/api/session")["store"]
    finally:
        served.close()


_POSE = {
    "azimuth": 10.0, "elevation": 5.0, "inplane": 0.0,
    "focal_px": 100.0, "principal_px": [50.0, 40.0], "t_z": 2.0,
}  # fmt: skip


@pytest.mark.parametrize(
    "body",
    [
        {"verdict": "maybe"},
        {"verdict": "auto_accept"},
        {"verdict": "edit"},
        {"verdict": "accept", "pose": _POSE},
        {"version": -1},
        {"version": None},
        {"author": "x" * 201},
        {"note": "x" * 10_001},
        {"other": 1},
        {"request_id": "0" * 31},
        {"request_id": "G" * 32},
        {"verdict": "edit", "pose": _POSE | {"focal_px": 0.0}},
        {"verdict": "edit", "pose": _POSE | {"focal_px": 1e9}},
        {"verdict": "edit", "pose": _POSE | {"elevation": 91.0}},
        {"verdict": "edit", "pose": _POSE | {"t_z": 0.2}},
        {"verdict": "edit", "pose": _POSE | {"principal_px": [1e12, 0.0]}},
        {"verdict": "edit", "pose": _POSE | {"principal_px": [1.0]}},
        {"verdict": "edit", "pose": _POSE | {"azimuth": "north"}},
        {"verdict": "edit", "pose": {k: v for k, v in _POSE.items() if k != "t_z"}},
        {"verdict": "edit", "cad_id": "no such model"},
        {"verdict": "edit", "region": {"box": [1, 1, 1, 5], "mask": None}},
        {"verdict": "edit", "region": {"box": [900, 900, 950, 950], "mask": None}},
        {"verdict": "edit", "region": {"box": [1, 1, 9], "mask": None}},
        {"verdict": "edit", "region": {"box": [1, 1, 9, 9], "mask": {"size": [2, 2], "counts": "4"}}},
        {"verdict": "edit", "region": {"box": [1, 1, 9, 9], "mask": {"size": [80, 120], "counts": "~~"}}},
        {"verdict": "edit", "region": {"box": [1, 1, 9, 9], "mask": {"size": [80, 120], "counts": "00"}}},
        {"verdict": "edit", "region": {"box": [1, 1, 9, 9], "mask": {"size": [80, 120], "counts": "P\\9"}}},
        {"verdict": "edit", "region": {"box": [1, 1, 9, 9], "mask": {"size": [10**9, 10**9], "counts": ""}}},
    ],
)
def test_decisions_that_cannot_be_used(shared: Served, body: dict[str, Any]) -> None:
    key = next(k for k in shared.ids() if shared.desk.stored(k).item.photo_size == (120, 80))
    told = decide(shared, key, 422, **body)
    assert told["kind"] == "bad_input" and "\n" not in told["error"]
    assert detail(shared, key).version == 1


@pytest.mark.parametrize("number", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_numbers_that_are_not_finite(shared: Served, number: str) -> None:
    key = shared.ids()[0]
    for name in ("azimuth", "focal_px", "t_z"):
        pose = ", ".join(
            f'"{n}": {number if n == name else v}' for n, v in _POSE.items() if n != "principal_px"
        )
        body = f'{{"verdict": "edit", "version": 1, "pose": {{{pose}, "principal_px": [1, 2]}}}}'
        answer = shared.client.post(f"/api/annotations/{key}/decisions", content=body)
        assert answer.status_code == 422 and answer.json()["kind"] == "bad_input"


def test_an_unknown_annotation(shared: Served) -> None:
    assert decide(shared, "0" * 64, 404)["kind"] == "not_found"


def test_statistics(served: Served) -> None:
    for number, key in enumerate(served.ids()[:3]):
        decide(served, key, verdict=("accept", "reject", "skip")[number])
    told = served.get("/api/stats")
    assert told["total"] == 4 and told["decided"] == 2
    assert served.get("/api/progress") == {"total": 4, "decided": 2}
    # Sent back for another look it is not decided any more, nor is what a program says.
    decide(served, served.ids()[0], verdict="review", version=2)
    assert served.get("/api/progress") == {"total": 4, "decided": 1}
    assert served.get("/api/stats")["decided"] == 1
    assert [(a["author"], a["decisions"], a["last_hour"]) for a in told["authors"]] == [("Bea", 3, 3)]
    assert sum(day["decisions"] for day in told["days"]) == 3
    assert told["agreement"]["with_machine"]["accepted_unchanged"] == 1
