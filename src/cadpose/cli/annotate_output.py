"""What ``cadpose annotate`` says of the photos when all is done: JSON, or a table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from cadpose.cli.output import print_table

if TYPE_CHECKING:
    from cadpose.batch.outcome import PhotoOutcome
    from cadpose.batch.record import AnnotatedObject, FoundObject, LeftOutObject
    from cadpose.detection import DetectionSource

#: More photos are counted, not listed; the run's pages show them.
_MOST_ROWS = 200
_COLUMNS = [
    "category",
    "CAD model",
    "chance",
    "azimuth elevation in-plane",
    "probability",
    "focal length",
    "box IoU",
    "verdict",
    "flags",
]


class RunOutput:
    """Gathers the outcomes of a run.

    Args:
        photos: The photos of the run, in the order in which they are told.
        known: What told the objects, where the detector did not look.
    """

    def __init__(self, photos: Sequence[Path], known: DetectionSource | None) -> None:
        self._order = {photo: number for number, photo in enumerate(photos)}
        self._known = known
        self._outcomes: list[PhotoOutcome] = []
        #: Whether anything could not be annotated.
        self.complained = False

    def add(self, outcome: PhotoOutcome) -> None:
        """One more."""
        self.complained |= bool(complaints(outcome))
        self._outcomes.append(outcome)

    def entries(self) -> list[dict[str, Any]]:
        """One a photo, as ``--json`` prints it."""
        return [_entry(outcome) | {"named": self._names(outcome)} for outcome in self._ordered()]

    def print(self, out: Path) -> None:
        """Print the table, or what it comes to where it would be long."""
        rows: list[list[str]] = []
        few = len(self._outcomes) <= _MOST_ROWS
        for outcome in self._ordered():
            if few or complaints(outcome):
                rows += _rows(outcome, self._names(outcome))
        if not few:
            failed = sum(outcome.record is None for outcome in self._outcomes)
            objects = sum(len(o.record.objects) for o in self._outcomes if o.record and not o.same_as)
            typer.echo(f"{len(self._outcomes)} photos, {objects} objects annotated, {failed} photos failed")
        if few or rows:
            title = f"{len(self._outcomes)} photos" if few else "What was not annotated"
            print_table(title, ["photo", *_COLUMNS], rows[:_MOST_ROWS])
        typer.echo(f"Pictures and documents: {out / 'index.html'}")
        if len(self._outcomes) > 1:
            typer.echo(f"Report: {out / 'report.html'}")

    def _ordered(self) -> list[PhotoOutcome]:
        return sorted(self._outcomes, key=lambda outcome: self._order[outcome.photo])

    def _names(self, outcome: PhotoOutcome) -> bool:
        return self._known is None or self._known.knows(str(outcome.photo))


def complaints(outcome: PhotoOutcome) -> list[str]:
    """A sentence for the photo if it failed, or for each of its objects that did."""
    if outcome.record is None:
        earlier = " (it failed earlier, --retry-failed tries it again)" if outcome.resumed else ""
        return [f"{outcome.error}{earlier}"]
    if outcome.same_as is not None:
        return []
    return [f"{outcome.photo}: {lost.category} left out: {lost.reason}" for lost in outcome.record.left_out]


def _entry(outcome: PhotoOutcome) -> dict[str, Any]:
    told: dict[str, Any] = {"photo": str(outcome.photo), "error": outcome.error or None}
    if outcome.same_as is not None:
        told["same_as"] = str(outcome.same_as)
    if outcome.record is not None:
        told |= {
            "document": str(outcome.paths.json),
            "overlay": str(outcome.paths.overlay),
            "resumed": outcome.resumed,
            "annotations": [_annotation(found) for found in outcome.record.objects],
            "failures": [_left_out(lost) for lost in outcome.record.left_out],
        }
    return told


def _annotation(found: AnnotatedObject) -> dict[str, Any]:
    return {
        "category": found.category,
        **_doubts(found),
        "cad": found.cad_id,
        "azimuth": found.azimuth,
        "elevation": found.elevation,
        "inplane": found.inplane,
        "focal_px": found.focal_px,
        "probability": found.probability,
        "expected_error": found.expected_error,
        "needs_review": found.needs_review,
        "cad_probability": found.cad_probability,
        "none_probability": found.none_probability,
        "cad_needs_review": found.cad_needs_review,
        "confidence": found.confidence,
        "verdict": found.verdict,
        "box": found.box,
        "box_iou": found.box_iou,
        "mask_iou": found.mask_iou,
    }


def _left_out(lost: LeftOutObject) -> dict[str, Any]:
    return {"category": lost.category, **_doubts(lost), "reason": lost.reason}


def _doubts(found: FoundObject) -> dict[str, Any]:
    """What may be wrong with the detection."""
    return {
        "alternatives": [{"category": category, "score": score} for category, score in found.alternatives],
        "truncated": found.truncated,
        "tiny": found.tiny,
        "unsure": found.unsure,
    }


def _rows(outcome: PhotoOutcome, named: bool) -> list[list[str]]:
    from cadpose.annotations.style import flags_of

    name, record = outcome.photo.name, outcome.record
    empty = [""] * len(_COLUMNS)
    if record is None:
        return [[name, "failed", *empty[1:]]]
    if outcome.same_as is not None:
        return [[name, "same bytes as", outcome.same_as.name, *empty[2:]]]
    if not record.objects and not record.left_out:
        return [[name, "no object found" if named else "the file does not name it", *empty[1:]]]
    rows = []
    for found in record.objects:
        # 359.7° is 0°, not 360°.
        azimuth = round(found.azimuth) % 360
        probability = "" if found.probability is None else f"{found.probability:.2f}"
        rows.append(
            [
                name,
                _category(found),
                found.cad_name,
                _chance(found),
                f"{azimuth}° {round(found.elevation):+d}° {round(found.inplane):+d}°",
                f"needs review {probability}" if found.needs_review else probability,
                f"{found.focal_px:.0f} px",
                f"{found.box_iou:.2f}",
                "" if found.verdict is None else f"{found.verdict.replace('_', ' ')} {found.confidence:.2f}",
                " ".join(flags_of(found)),
            ]
        )
    rows += [
        [name, _category(lost), "left out", *empty[3:], " ".join(flags_of(lost))] for lost in record.left_out
    ]
    return rows


def _category(found: FoundObject) -> str:
    from cadpose.annotations.style import category_text

    others = (category for category, _ in found.alternatives)
    return category_text(found.category, others, found.unsure)


def _chance(found: AnnotatedObject) -> str:
    """The first model's chance, or that none of the candidates is the object's."""
    chance, none = found.cad_probability, found.none_probability
    if chance is None or none is None:
        return ""
    if none > 0.5:
        return f"none fits {none:.2f}"
    return f"needs review {chance:.2f}" if found.cad_needs_review else f"{chance:.2f}"
