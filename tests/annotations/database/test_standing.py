"""Which annotations hold, without a database."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from cadpose.annotations.database.standing import Standing, in_force, settled
from cadpose.records import Rotation


def at(minute: int) -> datetime:
    return datetime(2026, 1, 1, 12, minute, tzinfo=UTC)


def standing(key: str, document: str, x: float = 0.0, **changes: Any) -> Standing:
    values: dict[str, Any] = {
        "box": (x, 0.0, x + 10.0, 10.0),
        "answer": ("car", "cad-0"),
        "rotation": Rotation(0.0, 0.0),
        "settled": None,
        "settled_at": None,
    }
    return Standing(id=key, document=document, **(values | changes))


def by_a_person(verdict: str, minute: int = 1) -> dict[str, Any]:
    return {"settled": verdict, "settled_at": at(minute)}


def test_the_newest_document_holds() -> None:
    assert in_force([standing("a", "1"), standing("b", "2"), standing("c", "2", 50.0)], "2") == {"b", "c"}
    assert in_force([], "1") == set()


def test_one_former_answer_takes_the_place_of_one_new_one() -> None:
    # Two new boxes lie on the old one: the nearer one stands back.
    former = standing("a", "1", **by_a_person("accept"))
    assert in_force([former, standing("b", "2", 3.0), standing("c", "2", 1.0)], "2") == {"a", "b"}


def test_neighbours_of_one_document_never_stand_in_each_others_way() -> None:
    rider = [standing(key, "1", x, **by_a_person("accept")) for key, x in (("a", 0.0), ("b", 1.0))]
    assert in_force([*rider, standing("c", "2", 40.0)], "2") == {"a", "b", "c"}


def test_a_later_word_beats_an_earlier_one() -> None:
    first = standing("a", "1", **by_a_person("accept", 1))
    second = standing("b", "2", **by_a_person("edit", 2))
    assert in_force([first, second, standing("c", "3")], "3") == {"b"}
    assert in_force([first, standing("b", "2", **by_a_person("accept", 0))], "2") == {"a"}
    assert in_force([first, second], "2") == {"b"}


def test_a_rejected_answer_comes_back_only_as_the_same() -> None:
    rejected = standing("a", "1", **by_a_person("reject"))
    assert in_force([rejected, standing("b", "2", rotation=Rotation(8.0, 0.0))], "2") == {"a"}
    assert in_force([rejected, standing("b", "2", rotation=Rotation(12.0, 0.0))], "2") == {"b"}
    assert in_force([rejected, standing("b", "2", answer=("car", "cad-1"))], "2") == {"b"}
    assert in_force([rejected, standing("b", "2", 20.0)], "2") == {"b"}


def decision(minute: int, verdict: str, kind: str = "human", **changes: Any) -> dict[str, Any]:
    row = {"id": f"{minute}", "kind": kind, "author": "x", "decided_at": at(minute), "verdict": verdict}
    return row | {"pose_after": None, "cad_after": None, "region_after": None, "measures": None} | changes


def test_decisions_come_to_one_verdict() -> None:
    nothing = settled([])
    assert (nothing.verdict, nothing.decided_by, nothing.edit, nothing.settled) == (None, None, None, None)
    machine = decision(1, "auto_accept", "program")
    assert settled([machine]).decided_by == "program" and settled([machine]).settled is None
    # A person's word stands whatever a program says later; a skip is no word.
    both = settled([decision(5, "review", "program"), decision(2, "reject"), machine, decision(9, "skip")])
    assert (both.verdict, both.decided_by, both.settled, both.settled_at) == (
        "reject",
        "human",
        "reject",
        at(2),
    )
    back = settled([decision(2, "accept"), decision(3, "review")])
    assert (back.verdict, back.settled) == ("review", None)


def test_edits_add_up() -> None:
    made = settled(
        [
            decision(3, "edit", cad_after="k2", author="Ben"),
            decision(2, "edit", pose_after={"azimuth": 1.0}, cad_after="k1", measures={"box_iou": 0.5}),
            decision(4, "accept"),
        ]
    )
    assert made.verdict == "accept"
    assert made.edit == {
        "pose": {"azimuth": 1.0}, "cad": "k2", "measures": {}, "by": "Ben", "kind": "human",
        "at": at(3).isoformat(),
    }  # fmt: skip
