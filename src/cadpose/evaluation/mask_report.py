"""The report of a mask evaluation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from cadpose.annotations.parts import plain_text
from cadpose.evaluation.mask_tables import MaskTables
from cadpose.evaluation.masks import MaskOutcome
from cadpose.evaluation.outline_report import Outlined, Sheet, worst_typical_best, write_report


def write_mask_report(
    folder: Path, tables: MaskTables, outcomes: Sequence[MaskOutcome], facts: Mapping[str, str]
) -> Path:
    """Write the report; the page last.

    Args:
        folder: Made where it is missing; files of an earlier report are replaced.
        tables: What is told.
        outcomes: Every object's.
        facts: Further facts for the page's head.

    Returns:
        The page's path.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    names = list(tables.total)
    by = names[0]
    ordered = sorted(outcomes, key=lambda o: (o.scores[by].iou, str(o.photo), o.box.to_tuple()))
    sheets = [
        Sheet(f"{name.capitalize()} by {by}", tuple(_outlined(outcome, names) for outcome in some))
        for name, some in worst_typical_best(ordered).items()
    ]
    told = {**tables.facts(), **facts}
    entries = (_entry(outcome) for outcome in outcomes)
    return write_report(folder, tables, told, entries, sheets, ("true", "found"))


def _outlined(outcome: MaskOutcome, names: Sequence[str]) -> Outlined:
    found = []
    for name in names:
        score = outcome.scores[name]
        found.append((f"{name}: IoU {score.iou:.2f}, F {score.boundary:.2f}", score.mask.decode()))
    return Outlined(outcome.photo, outcome.category, outcome.box, outcome.truth.decode(), tuple(found))


def _entry(outcome: MaskOutcome) -> dict[str, Any]:
    return {
        "photo": plain_text(str(outcome.photo)),
        "category": plain_text(outcome.category),
        "box": [round(v, 3) for v in outcome.box.to_tuple()],
        "masks": {
            name: {
                "iou": round(score.iou, 5),
                "boundary_f": round(score.boundary, 5),
                "seconds": round(score.seconds, 5),
            }
            for name, score in outcome.scores.items()
        },
    }
