"""The report of an alignment evaluation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cadpose.annotations.parts import plain_text
from cadpose.evaluation.alignment import AlignmentOutcome
from cadpose.evaluation.alignment_tables import AlignmentTables
from cadpose.evaluation.outline_report import Outlined, Sheet, worst_typical_best, write_report


def write_alignment_report(
    folder: Path, tables: AlignmentTables, outcomes: Sequence[AlignmentOutcome]
) -> Path:
    """Write the report; the page last.

    Args:
        folder: Made where it is missing; files of an earlier report are replaced.
        tables: What is told.
        outcomes: Every object's.

    Returns:
        The page's path.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    names = list(tables.total)
    by = [name for name in names if all(name in outcome.scores for outcome in outcomes)]
    way = by[min(1, len(by) - 1)]
    ordered = sorted(outcomes, key=lambda o: (o.scores[way].silhouette_iou, str(o.label.photo)))
    sheets = [
        Sheet(
            f"{name.capitalize()} by silhouette IoU of {way}",
            tuple(_outlined(outcome, names) for outcome in some),
        )
        for name, some in worst_typical_best(ordered).items()
    ]
    entries = (_entry(outcome) for outcome in outcomes)
    return write_report(folder, tables, tables.facts, entries, sheets, ("mask", "model"))


def _outlined(outcome: AlignmentOutcome, names: Sequence[str]) -> Outlined:
    found = []
    for name in names:
        score, outline = outcome.scores.get(name), outcome.outlines.get(name)
        told = "" if score is None else f": IoU {score.silhouette_iou:.2f}, {score.rotation_error:.0f}°"
        found.append((f"{name}{told}", None if outline is None else outline.decode()))
    label = outcome.label
    return Outlined(label.photo, label.category, outcome.box, outcome.truth.decode(), tuple(found))


def _entry(outcome: AlignmentOutcome) -> dict[str, Any]:
    return {
        "photo": plain_text(str(outcome.label.photo)),
        "category": plain_text(outcome.label.category),
        "cad": plain_text(outcome.cad),
        "box": [round(v, 3) for v in outcome.box.to_tuple()],
        "labelled_mask": outcome.labelled_mask,
        "refine": {
            name: {
                "rotation_error": round(s.rotation_error, 3),
                "silhouette_iou": round(s.silhouette_iou, 5),
                "boundary_f": round(s.boundary, 5),
                "box_iou": round(s.box_iou, 5),
                "add": None if s.add is None else round(s.add, 5),
                "azimuth": round(s.pose.rotation.azimuth, 4),
                "elevation": round(s.pose.rotation.elevation, 4),
                "inplane": round(s.pose.rotation.inplane, 4),
                "focal_px": round(s.pose.focal_px, 4),
                "principal_px": [round(v, 4) for v in s.pose.principal_px],
                "seconds": round(s.seconds, 5),
            }
            for name, s in outcome.scores.items()
        },
    }
