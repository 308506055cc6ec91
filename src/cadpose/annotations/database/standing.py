"""Which annotations hold: a person's word outlives the runs of programs, and the later word the earlier.

Both rules are functions of what is stored alone, so ``check`` can work them out again, and two stores that
are merged either way round agree.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Any

import numpy as np

from cadpose.geometry.boxes import box_iou
from cadpose.poses import Rotation

#: Two detections of different runs are of one object from here on.
SAME_OBJECT_IOU = 0.5
#: A rejected answer that comes again this near is rejected already, degrees.
SAME_ROTATION = 10.0
#: A person's verdicts that settle something; "review" sends back, "skip" says nothing.
SETTLING = ("accept", "edit", "reject")


@dataclass(frozen=True, slots=True)
class Verdict:
    """What all decisions on one annotation come to.

    Attributes:
        verdict: What holds; None where nothing was decided.
        decided_by: ``"human"``, ``"program"`` or None.
        edit: JSON of what was changed, or None: ``pose``, ``cad`` (its key), ``region``, ``measures``,
            ``by``, ``kind``, ``at``.
        settled: A person's accept, edit or reject, None without.
        settled_at: When.
    """

    verdict: str | None
    decided_by: str | None
    edit: dict[str, Any] | None
    settled: str | None
    settled_at: datetime | None


def settled(decisions: Sequence[Mapping[str, Any]]) -> Verdict:
    """Fold rows of ``decisions`` of one annotation: people before programs, later before earlier."""
    in_order = sorted(decisions, key=lambda d: (d["kind"] == "human", d["decided_at"], d["id"]))
    edit: dict[str, Any] = {}
    for row in in_order:
        changes = [row[name] for name in ("pose_after", "cad_after", "region_after")]
        if any(change is not None for change in changes):
            edit |= {"by": row["author"], "kind": row["kind"], "at": row["decided_at"].isoformat()}
        if row["pose_after"] is not None:
            # Measures belong to the pose that they were taken of.
            edit |= {"pose": row["pose_after"], "measures": row["measures"] or {}}
        if row["cad_after"] is not None:
            edit |= {"cad": row["cad_after"], "measures": row["measures"] or {}}
        if row["region_after"] is not None:
            edit |= {"region": row["region_after"], "measures": row["measures"] or {}}
    people = [row for row in in_order if row["kind"] == "human"]
    word = _last_word(people)
    last = word or _last_word(in_order)
    final = word is not None and word["verdict"] in SETTLING
    return Verdict(
        verdict=None if last is None else last["verdict"],
        decided_by=None if last is None else last["kind"],
        edit=edit or None,
        settled=word["verdict"] if final and word is not None else None,
        settled_at=word["decided_at"] if final and word is not None else None,
    )


def _last_word(in_order: Sequence[Mapping[str, Any]]) -> Mapping[str, Any] | None:
    """The last that says something, None where all are skips."""
    telling = [row for row in in_order if row["verdict"] != "skip"]
    return telling[-1] if telling else None


@dataclass(frozen=True, slots=True)
class Standing:
    """An annotation of a photo, as far as it matters to what holds.

    Attributes:
        id: Its key.
        document: Digest of the document that it belongs to.
        box: (x0, y0, x1, y1).
        answer: Category and CAD that the machine gave.
        rotation: That the machine gave.
        settled: A person's accept, edit or reject.
        settled_at: When.
    """

    id: str
    document: str
    box: tuple[float, float, float, float]
    answer: tuple[str, str]
    rotation: Rotation
    settled: str | None
    settled_at: datetime | None


def in_force(standings: Sequence[Standing], newest: str) -> set[str]:
    """Keys of a photo's annotations that hold.

    Those of the newest document do, but where a person decided on a former answer of the same object. Then
    the former one goes on, accepted or edited; a rejected one only where the new answer is the same again.
    Of two people's words on one object the later holds.

    Args:
        standings: All annotations of one photo, of every document.
        newest: Digest of its newest document.
    """
    current = {s.id: s for s in standings if s.document == newest}
    holding = dict(current)
    formers = [s for s in standings if s.document != newest and s.settled is not None]
    formers.sort(key=lambda s: (s.settled_at is not None and s.settled_at.timestamp(), s.id), reverse=True)
    kept: list[Standing] = []
    for former in formers:
        if any(k.document != former.document and same_object(k, former) for k in kept):
            continue
        rivals = [s for s in current.values() if s.id in holding and same_object(s, former)]
        rival = max(rivals, key=lambda s: (_iou(s, former), s.id), default=None)
        if rival is None:
            if former.settled == "reject":
                continue
        elif rival.settled_at is not None and former.settled_at is not None:
            if rival.settled_at >= former.settled_at:
                continue
        elif former.settled == "reject" and not _same_answer(rival, former):
            continue
        if rival is not None:
            del holding[rival.id]
        holding[former.id] = former
        kept.append(former)
    return set(holding)


def same_object(a: Standing, b: Standing) -> bool:
    """Whether two detections are of one object."""
    return _iou(a, b) >= SAME_OBJECT_IOU


def _iou(a: Standing, b: Standing) -> float:
    return float(box_iou(np.array(a.box), np.array(b.box)))


def _same_answer(a: Standing, b: Standing) -> bool:
    return a.answer == b.answer and a.rotation.error_to(b.rotation) <= SAME_ROTATION
