from __future__ import annotations

from collections.abc import Callable, Iterator
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from cadpose.annotations.database import deciding
from cadpose.annotations.database.reviewing import MachineAgrees, PeopleAgree
from cadpose.annotations.store import Author, DecisionVerdict, Store
from cadpose.records import Pose4Dof, Rotation
from tests.annotations.factory import make_document

ANNA, BEN, PROGRAM = Author("Anna"), Author("Ben"), Author("sorter", "program")
# After the program's own decision, which is of now.
NOON = datetime(2199, 3, 1, 12, 0, tzinfo=UTC)
Clock = Callable[[float], None]


def pose(azimuth: float) -> Pose4Dof:
    return Pose4Dof(Rotation(azimuth, 5.0), 150.0, (60.0, 40.0))


@pytest.fixture
def store(url: str) -> Iterator[Store]:
    with Store(url) as store:
        store.add_many(make_document(f"{name}.jpg", annotations=1) for name in "abcd")
        yield store


@pytest.fixture
def at(monkeypatch: pytest.MonkeyPatch) -> Clock:
    """Sets the clock to some seconds after noon."""

    def set_to(seconds: float) -> None:
        clock = SimpleNamespace(now=lambda zone: NOON + timedelta(seconds=seconds))
        monkeypatch.setattr(deciding, "datetime", clock)

    return set_to


def test_a_store_that_nobody_looked_at(store: Store) -> None:
    told = store.reviewing()
    assert (told.total, told.decided, told.authors, told.days) == (4, 0, (), ())
    assert told.by_verdict == {"review": 4}
    assert told.between_people == PeopleAgree(0, None, None)
    assert told.with_machine == MachineAgrees(0, 0, 0, 0)


def test_progress_pace_and_agreement(store: Store, at: Clock) -> None:
    a, b, c, d = (item.annotation_id for item in store.queue().items)
    moves: list[tuple[float, str, DecisionVerdict, Author, float | None]] = [
        (0, a, "accept", ANNA, None),
        (10, b, "edit", ANNA, 50.0),
        (30, c, "reject", ANNA, None),
        (7200, d, "skip", ANNA, None),
        (7201, a, "edit", BEN, 20.0),
        (7203, b, "edit", BEN, 57.0),
        (7300, c, "accept", BEN, None),
        (90000, d, "auto_accept", PROGRAM, None),
    ]
    for seconds, key, verdict, author, azimuth in moves:
        at(seconds)
        changed = None if azimuth is None else pose(azimuth)
        store.decide(key, verdict, author, expected_version=None, pose=changed)
    told = store.reviewing(NOON + timedelta(seconds=7400))
    assert (told.total, told.decided) == (4, 3)
    assert told.by_verdict == {"edit": 2, "accept": 1, "auto_accept": 1}
    # Two hours between Anna's third and fourth are a pause.
    anna, ben = told.authors
    assert (anna.author, anna.decisions, anna.last_hour, anna.median_seconds) == ("Anna", 4, 1, 15.0)
    assert (ben.author, ben.decisions, ben.last_hour, ben.median_seconds) == ("Ben", 3, 3, 49.5)
    assert told.days == (("2199-03-01", 7),)
    machine = store.annotations(original=True)[0].pose.rotation
    assert told.between_people.pairs == 3 and told.between_people.same_verdict == pytest.approx(2 / 3)
    # Of a: what the machine said and Anna accepted, against Ben's; of b: 50 against 57 degrees.
    angles = sorted(
        (machine.error_to(pose(20.0).rotation), pose(50.0).rotation.error_to(pose(57.0).rotation))
    )
    assert told.between_people.median_rotation_deg == pytest.approx(sum(angles) / 2)
    assert told.with_machine == MachineAgrees(3, 1, 2, 0)
