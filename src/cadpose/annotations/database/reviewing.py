"""How people get on with a store: progress, pace and agreement, from their decisions alone."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import combinations, pairwise
from statistics import median
from typing import Any

import sqlalchemy as sa

from cadpose.annotations.database import tables as t
from cadpose.annotations.database.engine import fetch
from cadpose.annotations.database.selection import UNDECIDED
from cadpose.annotations.database.standing import SETTLING
from cadpose.annotations.pose_parts import pose_of

#: Longer than this between two decisions of one person is a pause.
PAUSE = timedelta(minutes=10)


@dataclass(frozen=True, slots=True)
class Pace:
    """What one person has done.

    Attributes:
        author: The name.
        decisions: All of them, skips among them.
        last_hour: Those of the last hour.
        median_seconds: Between one decision and the next, pauses left out; None before the second.
    """

    author: str
    decisions: int
    last_hour: int
    median_seconds: float | None


@dataclass(frozen=True, slots=True)
class PeopleAgree:
    """Two people's last words on the same annotation, of every two.

    Attributes:
        pairs: How many.
        same_verdict: Share in which both would use it or both would not; None without a pair.
        median_rotation_deg: Between the rotations that both left, where both would use it.
    """

    pairs: int
    same_verdict: float | None
    median_rotation_deg: float | None


@dataclass(frozen=True, slots=True)
class MachineAgrees:
    """What people made of the machine's annotations.

    Attributes:
        decided: Annotations that people settled.
        accepted_unchanged: As they were.
        edited: After a change.
        rejected: Not to be used.
    """

    decided: int
    accepted_unchanged: int
    edited: int
    rejected: int


@dataclass(frozen=True, slots=True)
class Reviewing:
    """Progress, pace and agreement.

    Attributes:
        total: Annotations that hold.
        decided: Those that a person accepted, edited or rejected.
        by_verdict: What holds of how many.
        authors: The most decisions first.
        days: (day, decisions of people), UTC, the first day first.
        between_people: How far people agree.
        with_machine: How far they agree with the machine.
    """

    total: int
    decided: int
    by_verdict: dict[str, int]
    authors: tuple[Pace, ...]
    days: tuple[tuple[str, int], ...]
    between_people: PeopleAgree
    with_machine: MachineAgrees


def reviewing(connection: sa.Connection, now: datetime | None = None) -> Reviewing:
    """See ``Store.reviewing``."""
    a, d = t.ANNOTATIONS.c, t.DECISIONS.c
    holding = a.in_force == sa.true()
    human = sa.and_(holding, a.decided_by == "human", a.verdict.in_(SETTLING))
    number = sa.func.count()
    verdicts = sa.select(sa.func.coalesce(a.verdict, UNDECIDED), number).where(holding).group_by(a.verdict)
    by_verdict = {str(name): int(count) for name, count in connection.execute(verdicts)}
    made = connection.execute(
        sa.select(d.author, d.decided_at).where(d.kind == "human").order_by(d.decided_at, d.id)
    ).all()
    edited = a.edit.is_not(None)
    settled = sa.select(a.verdict, edited, number).where(human).group_by(a.verdict, edited)
    with_machine = _with_machine([(row[0], bool(row[1]), int(row[2])) for row in connection.execute(settled)])
    days = Counter(moment.date().isoformat() for _, moment in made)
    return Reviewing(
        total=sum(by_verdict.values()),
        decided=with_machine.decided,
        by_verdict=by_verdict,
        authors=_paces([(author, moment) for author, moment in made], now or datetime.now(UTC)),
        days=tuple(sorted(days.items())),
        between_people=_between_people(_of_several_people(connection)),
        with_machine=with_machine,
    )


def _of_several_people(connection: sa.Connection) -> list[dict[str, Any]]:
    """What people settled where more than one did: poses are read of few annotations."""
    d = t.DECISIONS.c
    word = sa.and_(d.kind == "human", d.verdict.in_(SETTLING))
    several = sa.select(d.annotation_id).where(word).group_by(d.annotation_id)
    several = several.having(sa.func.count(d.author.distinct()) > 1)
    names = ("annotation_id", "author", "verdict", "pose_before", "pose_after")
    query = sa.select(*(d[name] for name in names)).where(word, d.annotation_id.in_(several))
    return fetch(connection, query.order_by(d.decided_at, d.id))


def _paces(made: Sequence[tuple[str, datetime]], now: datetime) -> tuple[Pace, ...]:
    moments: dict[str, list[datetime]] = defaultdict(list)
    for author, moment in made:
        moments[author].append(moment)
    paces = []
    for author, times in moments.items():
        gaps = [(b - a).total_seconds() for a, b in pairwise(times) if b - a <= PAUSE]
        recent = sum(now - timedelta(hours=1) < moment <= now for moment in times)
        paces.append(Pace(author, len(times), recent, median(gaps) if gaps else None))
    return tuple(sorted(paces, key=lambda pace: (-pace.decisions, pace.author)))


def _between_people(made: Sequence[Mapping[str, Any]]) -> PeopleAgree:
    words: dict[str, dict[str, tuple[str, Any]]] = defaultdict(dict)
    for row in made:
        left = row["pose_after"] or row["pose_before"]
        words[row["annotation_id"]][row["author"]] = row["verdict"], left
    same, angles, pairs = 0, [], 0
    for said in words.values():
        for (one, pose), (other, other_pose) in combinations(said.values(), 2):
            pairs += 1
            same += (one == "reject") == (other == "reject")
            if "reject" not in (one, other):
                angles.append(pose_of(pose).rotation.error_to(pose_of(other_pose).rotation))
    return PeopleAgree(pairs, same / pairs if pairs else None, median(angles) if angles else None)


def _with_machine(rows: Sequence[tuple[str, bool, int]]) -> MachineAgrees:
    """Of (verdict, whether edited, how many)."""
    unchanged = sum(count for verdict, edit, count in rows if verdict == "accept" and not edit)
    rejected = sum(count for verdict, _, count in rows if verdict == "reject")
    decided = sum(count for _, _, count in rows)
    return MachineAgrees(decided, unchanged, decided - rejected - unchanged, rejected)
