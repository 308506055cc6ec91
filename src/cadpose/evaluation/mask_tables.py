"""Mask estimators side by side, over all objects and by category."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cadpose.evaluation.mask_quality import TOLERANCE
from cadpose.evaluation.masks import GOOD, MaskOutcome, MaskScore
from cadpose.evaluation.retrieval_tables import aligned
from cadpose.evaluation.statistics import wilson_interval


@dataclass(frozen=True, slots=True)
class MaskFigures:
    """Of one estimator over some objects.

    Attributes:
        objects: How many.
        mean: Mean IoU.
        median: Median IoU.
        good: Objects with an IoU of ``GOOD`` or more.
        boundary: Mean boundary F.
        ms: Median milliseconds a mask.
    """

    objects: int
    mean: float
    median: float
    good: int
    boundary: float
    ms: float

    @classmethod
    def of(cls, scores: Sequence[MaskScore]) -> MaskFigures:
        """Raises ValueError where there is none."""
        if not scores:
            raise ValueError("no mask to take the mean of")
        iou = np.array([score.iou for score in scores])
        return cls(
            len(iou),
            float(iou.mean()),
            float(np.median(iou)),
            int((iou >= GOOD).sum()),
            float(np.mean([score.boundary for score in scores])),
            1000.0 * float(np.median([score.seconds for score in scores])),
        )

    @property
    def good_interval(self) -> tuple[float, float]:
        """Wilson interval of the share of good ones."""
        return wilson_interval(self.good, self.objects)

    def to_json(self) -> dict[str, Any]:
        """Shares are fractions of 1."""
        return {
            "n": self.objects,
            "mean_iou": self.mean,
            "median_iou": self.median,
            "good": self.good / self.objects,
            "good_interval": list(self.good_interval),
            "boundary_f": self.boundary,
            "ms": self.ms,
        }


@dataclass(frozen=True)
class MaskTables:
    """Everything that one evaluation has to say.

    Attributes:
        dataset: Its name.
        synthetic: The photos were drawn.
        boxes: Where the boxes came from, in words.
        total: By estimator.
        by_category: By category, then by estimator.
        notes: Further sentences.
    """

    dataset: str
    synthetic: bool
    boxes: str
    total: Mapping[str, MaskFigures]
    by_category: Mapping[str, Mapping[str, MaskFigures]]
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Says first whether the photos are real."""
        return f"Masks, {'SYNTHETIC' if self.synthetic else 'real'} photos: {self.dataset}"

    def facts(self) -> dict[str, str]:
        """What was evaluated, name to value."""
        n = max((figures.objects for figures in self.total.values()), default=0)
        return {"Objects": str(n), "Boxes": self.boxes}

    def sentences(self) -> list[str]:
        """What has to be said below the tables."""
        far = f"{100 * TOLERANCE:g} % of the photo's diagonal"
        return [f"Boundary F: outlines agree within {far}, as DAVIS counts.", *self.notes]

    def tables(self) -> list[tuple[str, list[list[str] | None]]]:
        """(caption, rows of cells) of each table, the first row its heads; None stands for a line."""
        good = f"IoU >= {GOOD:g}, % [95 %]"
        lines: list[list[str] | None] = [
            ["Masks", "Objects", "Mean IoU", "Median IoU", good, "Boundary F", "ms a mask"],
            None,
        ]
        for name, f in self.total.items():
            low, high = f.good_interval
            share = f"{100 * f.good / f.objects:.1f} [{100 * low:.1f}, {100 * high:.1f}]"
            lines.append(
                [name, str(f.objects), f"{f.mean:.3f}", f"{f.median:.3f}", share, f"{f.boundary:.3f}",
                 f"{f.ms:.0f}"]
            )  # fmt: skip
        heads = ["Category", "Objects"]
        for name in self.total:
            heads += [f"{name}: IoU", f"IoU >= {GOOD:g}, %", "F"]
        rows: list[list[str] | None] = [heads, None]
        for category, by in self.by_category.items():
            cells = [category, str(next(iter(by.values())).objects)]
            for f in by.values():
                cells += [f"{f.mean:.3f}", f"{100 * f.good / f.objects:.1f}", f"{f.boundary:.3f}"]
            rows.append(cells)
        return [("All", lines), ("By category", rows)]

    def to_text(self) -> str:
        """Title, facts, the table of estimators, that by category, and notes."""
        head = self.title + "\n" + "\n".join(f"{name}: {told}" for name, told in self.facts().items())
        parts = [head, *(f"{name}\n{aligned(lines)}" for name, lines in self.tables())]
        return "\n\n".join([*parts, "\n".join(self.sentences())]) + "\n"

    def to_csv(self) -> str:
        """One row an estimator over all objects, and one a category of each."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        columns = ["mean_iou", "median_iou", "good", "good_low", "good_high", "boundary_f", "ms"]
        writer.writerow(["photos_are", "dataset", "masks", "category", "objects", *columns])
        kind = "synthetic" if self.synthetic else "real"
        for category, by in (("all", self.total), *self.by_category.items()):
            for name, f in by.items():
                numbers = (f.mean, f.median, f.good / f.objects, *f.good_interval, f.boundary, f.ms)
                told = [f"{number:.5f}" for number in numbers]
                writer.writerow([kind, self.dataset, name, category, f.objects, *told])
        return out.getvalue()

    def to_json(self) -> dict[str, Any]:
        """One object; see docs/evaluation.md for its keys."""
        return {
            "title": self.title,
            "synthetic": self.synthetic,
            "dataset": self.dataset,
            "boxes": self.boxes,
            "notes": list(self.notes),
            "masks": {
                name: figures.to_json()
                | {"classes": {category: by[name].to_json() for category, by in self.by_category.items()}}
                for name, figures in self.total.items()
            },
        }


def mask_tables(
    outcomes: Sequence[MaskOutcome],
    *,
    dataset: str,
    synthetic: bool = False,
    boxes: str = "as labelled",
    notes: tuple[str, ...] = (),
) -> MaskTables:
    """The tables of an evaluation.

    Raises:
        ValueError: there is no outcome.
    """

    def by_estimator(some: Sequence[MaskOutcome]) -> dict[str, MaskFigures]:
        return {name: MaskFigures.of([o.scores[name] for o in some]) for name in outcomes[0].scores}

    if not outcomes:
        raise ValueError("no mask was compared")
    categories = sorted({outcome.category for outcome in outcomes})
    return MaskTables(
        dataset,
        synthetic,
        boxes,
        by_estimator(outcomes),
        {c: by_estimator([o for o in outcomes if o.category == c]) for c in categories},
        notes,
    )
