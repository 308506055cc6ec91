"""Ways of placing side by side, over all objects and by category."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cadpose.evaluation.alignment import CEILING, AlignmentOutcome, AlignmentScore
from cadpose.evaluation.mask_quality import TOLERANCE
from cadpose.evaluation.retrieval_tables import aligned
from cadpose.evaluation.statistics import wilson_interval

_COLUMNS = [
    "", "objects", "MedErr", "Acc@10 [95 %]", "Acc@30", "median IoU", "mean IoU", "boundary F", "box IoU",
    "ADD", "ms",
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class AlignmentFigures:
    """Of one way over some objects.

    Attributes:
        objects: How many.
        mederr: Median rotation error in degrees.
        within10: Objects within 10 degrees.
        within30: Objects within 30 degrees.
        median_iou: Median silhouette IoU.
        mean_iou: Mean silhouette IoU.
        boundary: Mean boundary F.
        box_iou: Median box IoU.
        add: Median of the mean projected distance, as a share of the box's diagonal; None where no label
            tells a full pose.
        ms: Median milliseconds.
    """

    objects: int
    mederr: float
    within10: int
    within30: int
    median_iou: float
    mean_iou: float
    boundary: float
    box_iou: float
    add: float | None
    ms: float

    @classmethod
    def of(cls, scores: Sequence[AlignmentScore]) -> AlignmentFigures:
        """Raises ValueError where there is none."""
        if not scores:
            raise ValueError("no pose to take the mean of")
        errors = np.array([s.rotation_error for s in scores])
        iou = np.array([s.silhouette_iou for s in scores])
        distances = [s.add for s in scores if s.add is not None]
        return cls(
            len(scores),
            float(np.median(errors)),
            int((errors <= 10.0).sum()),
            int((errors <= 30.0).sum()),
            float(np.median(iou)),
            float(iou.mean()),
            float(np.mean([s.boundary for s in scores])),
            float(np.median([s.box_iou for s in scores])),
            float(np.median(distances)) if distances else None,
            1000.0 * float(np.median([s.seconds for s in scores])),
        )

    @property
    def within10_interval(self) -> tuple[float, float]:
        """Wilson interval of the share within 10 degrees."""
        return wilson_interval(self.within10, self.objects)

    def to_json(self) -> dict[str, Any]:
        """Shares are fractions of 1."""
        return {
            "n": self.objects,
            "mederr": self.mederr,
            "acc10": self.within10 / self.objects,
            "acc10_interval": list(self.within10_interval),
            "acc30": self.within30 / self.objects,
            "median_iou": self.median_iou,
            "mean_iou": self.mean_iou,
            "boundary_f": self.boundary,
            "box_iou": self.box_iou,
            "add": self.add,
            "ms": self.ms,
        }


@dataclass(frozen=True)
class AlignmentTables:
    """Everything that one evaluation has to say.

    Attributes:
        dataset: Its name.
        synthetic: The photos were drawn.
        facts: What was evaluated, name to value.
        total: By way.
        by_category: By category, then by way.
        notes: Further sentences.
    """

    dataset: str
    synthetic: bool
    facts: Mapping[str, str]
    total: Mapping[str, AlignmentFigures]
    by_category: Mapping[str, Mapping[str, AlignmentFigures]]
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Says first whether the photos are real."""
        return f"Alignment, {'SYNTHETIC' if self.synthetic else 'real'} photos: {self.dataset}"

    def tables(self) -> list[tuple[str, list[list[str] | None]]]:
        """Captions and rows."""
        told: list[tuple[str, list[list[str] | None]]] = [("All objects", _rows(self.total))]
        if len(self.by_category) > 1:
            told += [(category, _rows(by)) for category, by in self.by_category.items()]
        return told

    def sentences(self) -> list[str]:
        """What has to be said below the tables."""
        told = [
            f"Boundary F: outlines agree within {100 * TOLERANCE:g} % of the photo's diagonal. ADD: mean "
            "distance of projected vertices from their true places, over the box's diagonal.",
            *self.notes,
        ]
        if CEILING in self.total:
            told.insert(
                0, "ceiling: the true model at the labelled rotation, focal length and offset fitted to the "
                "mask that silhouettes are compared with.",
            )  # fmt: skip
        return told

    def to_text(self) -> str:
        """For a terminal."""
        parts = [self.title, *(f"{name}: {value}" for name, value in self.facts.items())]
        parts += [f"\n{caption}\n{aligned(rows)}" for caption, rows in self.tables()]
        return "\n".join([*parts, "", *self.sentences()]) + "\n"

    def to_csv(self) -> str:
        """A line a category and way."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        kind = "synthetic" if self.synthetic else "real"
        for i, (category, by) in enumerate((("all", self.total), *self.by_category.items())):
            for name, figures in by.items():
                told = figures.to_json()
                low, high = told.pop("acc10_interval")
                told |= {"acc10_low": low, "acc10_high": high}
                if not i and name == next(iter(by)):
                    writer.writerow(["photos_are", "dataset", "category", "refine", *told])
                numbers = [f"{v:.5f}" if isinstance(v, float) else v for v in told.values()]
                writer.writerow([kind, self.dataset, category, name, *numbers])
        return out.getvalue()

    def to_json(self) -> dict[str, Any]:
        """One object; see docs/evaluation.md for its keys."""
        return {
            "title": self.title,
            "synthetic": self.synthetic,
            "dataset": self.dataset,
            "facts": dict(self.facts),
            "notes": list(self.notes),
            "refine": {
                name: figures.to_json()
                | {"classes": {c: by[name].to_json() for c, by in self.by_category.items() if name in by}}
                for name, figures in self.total.items()
            },
        }


def alignment_tables(
    outcomes: Sequence[AlignmentOutcome],
    *,
    dataset: str,
    synthetic: bool,
    facts: Mapping[str, str],
    notes: tuple[str, ...] = (),
) -> AlignmentTables:
    """The tables of an evaluation.

    Raises:
        ValueError: there is no outcome.
    """

    def by_way(some: Sequence[AlignmentOutcome]) -> dict[str, AlignmentFigures]:
        names = dict.fromkeys(name for outcome in some for name in outcome.scores)
        return {n: AlignmentFigures.of([o.scores[n] for o in some if n in o.scores]) for n in names}

    if not outcomes:
        raise ValueError("no object was placed")
    categories = sorted({outcome.label.category for outcome in outcomes})
    return AlignmentTables(
        dataset,
        synthetic,
        facts,
        by_way(outcomes),
        {c: by_way([o for o in outcomes if o.label.category == c]) for c in categories},
        notes,
    )


def _rows(by: Mapping[str, AlignmentFigures]) -> list[list[str] | None]:
    rows: list[list[str] | None] = [_COLUMNS, None]
    for name, f in by.items():
        low, high = f.within10_interval
        rows.append(
            [
                name,
                str(f.objects),
                f"{f.mederr:.1f}°",
                f"{f.within10 / f.objects:.1%} [{low:.1%}, {high:.1%}]",
                f"{f.within30 / f.objects:.1%}",
                f"{f.median_iou:.3f}",
                f"{f.mean_iou:.3f}",
                f"{f.boundary:.3f}",
                f"{f.box_iou:.3f}",
                "-" if f.add is None else f"{f.add:.3f}",
                f"{f.ms:.0f}",
            ]
        )
    return rows
