from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from cadpose.annotations.database import selection
from cadpose.annotations.document import document_from
from cadpose.annotations.store import Author, QueueItem, Selection, Store
from cadpose.errors import InputError
from cadpose.records import Candidate, Detection, Rotation
from tests.annotations.factory import make_annotation, make_cad, make_photo


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    with Store(url) as store:
        fill(store)
        yield store


def fill(store: Store, number: int = 25) -> None:
    """Photos of one object each; every fifth tells no confidence, every third is a bus with CAD 7."""
    documents = []
    for i in range(number):
        photo = make_photo(f"street {i:02}%.jpg" if i % 2 else f"Yard_{i:02}.jpg")
        changes: dict[str, Any] = {"confidence": None if i % 5 == 0 else i % 7 / 7}
        changes["verdict"] = None if i % 5 == 0 else "auto_accept" if i % 7 > 4 else "review"
        if i % 3 == 0:
            box = make_annotation(photo).detection.box
            changes["detection"] = Detection(box, "bus")
            changes["candidates"] = (Candidate(make_cad(7, name="Bus 100%"), 1.0, Rotation(0.0, 0.0)),)
        documents.append(document_from(photo, [make_annotation(photo, **changes)]))
    store.add_many(documents)


def numbers(store: Store, wanted: Selection) -> list[int]:
    """The photos' numbers, as a list of pages and as a stream: both take the same."""
    listed = [int(item.photo_name.split(".")[0].rstrip("%")[-2:]) for item in all_items(store, wanted, 4)]
    streamed = [int(a.photo_name.split(".")[0].rstrip("%")[-2:]) for a in store.iter_annotations(wanted)]
    assert sorted(listed) == sorted(streamed) and len(listed) == store.count(wanted)
    return sorted(listed)


def all_items(store: Store, wanted: Selection, limit: int) -> list[QueueItem]:
    items: list[QueueItem] = []
    after = None
    while True:
        page = store.queue(wanted, after=after, limit=limit)
        assert len(page.items) <= limit
        items += page.items
        if page.after is None:
            return items
        after = page.after


def test_pages_join_to_the_whole_list(store: Store) -> None:
    whole = store.queue(limit=1000)
    assert whole.after is None and len(whole.items) == 25
    order = [-1.0 if item.confidence is None else item.confidence for item in whole.items]
    assert order == sorted(order) and order[0] == -1.0 and order[-1] > 0.8
    # Many are equal, so pages end between equal ones.
    for limit in (1, 4, 5, 25):
        assert all_items(store, Selection(), limit) == list(whole.items)
    item = next(item for item in whole.items if item.category == "car")
    stored = store.stored(item.annotation_id)
    assert stored is not None and stored.item == item and stored.annotation.photo_name == item.photo_name
    assert (item.photo_size, item.score, item.box_iou, item.edited) == ((120, 80), 0.875, 0.93, False)
    assert store.stored("none") is None


def test_filters_narrow_the_list(store: Store) -> None:
    everything = range(25)
    assert numbers(store, Selection()) == list(everything)
    assert numbers(store, Selection(category="bus")) == [i for i in everything if i % 3 == 0]
    assert numbers(store, Selection(cad_id="Set/cad-7.obj")) == [i for i in everything if i % 3 == 0]
    assert numbers(store, Selection(verdicts=("undecided",))) == [0, 5, 10, 15, 20]
    review = [i for i in everything if i % 5 and i % 7 <= 4]
    assert numbers(store, Selection(verdicts=("review",))) == review
    assert numbers(store, Selection(verdicts=("review", "undecided"))) == sorted({*review, 0, 5, 10, 15, 20})
    assert numbers(store, Selection(category="bus", verdicts=("review",))) == [
        i for i in review if i % 3 == 0
    ]
    middle = [i for i in everything if i % 5 and 2 / 7 <= i % 7 / 7 <= 0.6]
    assert numbers(store, Selection(min_confidence=2 / 7, max_confidence=0.6)) == middle
    assert numbers(store, Selection(max_confidence=0.0)) == [i for i in everything if i % 5 and i % 7 == 0]
    assert numbers(store, Selection(decided_by="human")) == []


def test_text_is_looked_for_in_names(store: Store, monkeypatch: pytest.MonkeyPatch) -> None:
    expected: dict[str, list[int]] = {
        "yard": list(range(0, 25, 2)),
        "STREET": list(range(1, 25, 2)),
        "0%": list(range(0, 25, 3)),
        "_1": [10, 12, 14, 16, 18],
        "bus 100": list(range(0, 25, 3)),
        "nothing": [],
        "' OR 1=1": [],
    }
    assert {text: numbers(store, Selection(text=text)) for text in expected} == expected
    # Where many photos match it is asked in another way.
    monkeypatch.setattr(selection, "_FEW", 3)
    assert {text: numbers(store, Selection(text=text)) for text in expected} == expected


def test_decisions_move_annotations_between_lists(store: Store) -> None:
    item = store.queue(Selection(verdicts=("review",))).items[0]
    store.decide(item.annotation_id, "accept", Author("Anna"), expected_version=item.version)
    assert item.annotation_id not in {
        i.annotation_id for i in store.queue(Selection(verdicts=("review",))).items
    }
    assert [i.annotation_id for i in store.queue(Selection(decided_by="human")).items] == [item.annotation_id]


@pytest.mark.parametrize(
    "bad",
    [
        {"verdicts": ("perfect",)},
        {"min_confidence": -0.1},
        {"max_confidence": float("nan")},
        {"decided_by": "robot"},
    ],
)
def test_selections_that_make_no_sense(bad: dict[str, Any]) -> None:
    with pytest.raises(InputError):
        Selection(**bad)


def test_pages_that_make_no_sense() -> None:
    with Store("sqlite://") as store:
        for limit in (0, 1001):
            with pytest.raises(InputError, match="1 to 1000"):
                store.queue(limit=limit)
        with pytest.raises(InputError, match="no key of a page"):
            store.queue(after="what?")
