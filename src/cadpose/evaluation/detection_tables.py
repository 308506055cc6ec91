"""Detectors side by side: average precision, and what is found at each one's own threshold."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cadpose.evaluation.coco_metrics import MOST, Average, average_precision
from cadpose.evaluation.detection import SAME_OBJECT, SIZES, Counts, PhotoOutcome, count, counts
from cadpose.evaluation.detection_run import Contestant
from cadpose.evaluation.retrieval_tables import aligned


@dataclass(frozen=True)
class DetectorRow:
    """One detector's figures.

    Attributes:
        name: The detector's.
        threshold: Its own lowest score, None where it does not tell.
        total: At that threshold, over all photos.
        by_category: The same by category.
        by_size: The same by size.
        boxes: Average precision of its boxes.
        masks: Average precision of its masks, None where it or the data set has none.
        foreign: Detections of categories that are not counted.
        seconds: A photo, in order.
    """

    name: str
    threshold: float | None
    total: Counts
    by_category: Mapping[str, Counts]
    by_size: Mapping[str, Counts]
    boxes: Average
    masks: Average | None
    foreign: int
    seconds: tuple[float, ...]

    @property
    def ms(self) -> float:
        """Median time of a photo in milliseconds."""
        return float(np.median(self.seconds)) * 1000.0 if self.seconds else 0.0

    @property
    def photos_per_second(self) -> float:
        """Of one after the other."""
        return len(self.seconds) / max(sum(self.seconds), 1e-9)


@dataclass(frozen=True)
class DetectionTables:
    """Everything that one evaluation has to say.

    Attributes:
        dataset: Its name.
        synthetic: The photos were drawn.
        photos: How many were used.
        categories: Those that count, and how many objects to be found each has.
        smallest: Pixels² below which objects are left aside.
        aside: Objects of these categories that are left aside: small ones, crowds, difficult ones.
        floor: Score down to which detections count for average precision.
        rows: One a detector.
        notes: Further sentences.
    """

    dataset: str
    synthetic: bool
    photos: int
    categories: Mapping[str, int]
    smallest: float
    aside: int
    floor: float
    rows: tuple[DetectorRow, ...]
    notes: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Says first whether the photos are real."""
        return f"Detection, {'SYNTHETIC' if self.synthetic else 'real'} photos: {self.dataset}"

    def facts(self) -> dict[str, str]:
        """What was evaluated, name to value."""
        shown = [name for name, n in self.categories.items() if n]
        lacking = len(self.categories) - len(shown)
        more = f", and {lacking} without an object" if lacking else ""
        return {
            "Photos": str(self.photos),
            "Objects": f"{sum(self.categories.values())} of {len(shown)} categories{more}",
            "Left aside": f"{self.aside} objects: below {self.smallest:g} px², crowds or difficult",
            "Right": f"the same category and a box IoU of at least {SAME_OBJECT:g}",
        }

    def sentences(self) -> list[str]:
        """What has to be said below the tables."""
        foreign = ", ".join(f"{row.name} {row.foreign}" for row in self.rows)
        return [
            f"AP: pycocotools, at most {MOST} detections a photo with a score of {self.floor:g} or more. "
            "Recall and precision: at each detector's own threshold.",
            "Any category: objects that some detection lies on, whatever it was taken for.",
            f"Detections of categories that are not counted here, neither right nor false: {foreign}.",
            *self.notes,
        ]

    def to_text(self) -> str:
        """Title, facts, the table of detectors, those by size and by category, and notes."""
        head = self.title + "\n" + "\n".join(f"{name}: {told}" for name, told in self.facts().items())
        parts = [head, *(f"{name}\n{aligned(lines)}" for name, lines in self.tables())]
        return "\n\n".join([*parts, "\n".join(self.sentences())]) + "\n"

    def tables(self) -> list[tuple[str, list[list[str] | None]]]:
        """(caption, rows of cells) of each table, the first row its heads; None stands for a line."""
        heads = [
            "Detector",
            "Threshold",
            "AP50",
            "AP",
            "Recall % [95 %]",
            "Precision % [95 %]",
            "Any category %",
        ]
        with_masks = any(row.masks is not None for row in self.rows)
        heads += [*(["Mask AP50", "Mask AP"] if with_masks else []), "ms a photo", "photos/s"]
        first: list[list[str] | None] = [heads, None]
        for row in self.rows:
            cells = [row.name, "-" if row.threshold is None else f"{row.threshold:g}"]
            cells += [_per_cent(row.boxes.ap50), _per_cent(row.boxes.ap), *_rates(row.total)]
            cells.append(_per_cent(_share(row.total.placed, row.total.objects)))
            if with_masks:
                cells += (
                    ["-", "-"] if row.masks is None else [_per_cent(row.masks.ap50), _per_cent(row.masks.ap)]
                )
            first.append([*cells, f"{row.ms:.0f}", f"{row.photos_per_second:.2f}"])
        sizes: list[list[str] | None] = [["Detector", "Size", "Objects", "AP50", "AP", *heads[4:6]], None]
        for row in self.rows:
            for name, *_ in SIZES:
                own = row.by_size.get(name, Counts())
                ap, ap50 = row.boxes.by_size.get(name, (None, None))
                sizes.append([row.name, name, str(own.objects), _per_cent(ap50), _per_cent(ap), *_rates(own)])
        many = len(self.rows) > 1
        heads = ["Category", "Objects"]
        for row in self.rows:
            heads += [f"{row.name}: {what}" if many else what for what in ("AP50", "recall", "precision")]
        by_category: list[list[str] | None] = [heads, None]
        for category, n in self.categories.items():
            if not n and not any(row.by_category.get(category, Counts()).false for row in self.rows):
                continue
            cells = [category, str(n)]
            for row in self.rows:
                own = row.by_category.get(category, Counts())
                ap50 = row.boxes.by_category[category][1]
                cells += [_per_cent(ap50), _per_cent(own.recall), _per_cent(own.precision)]
            by_category.append(cells)
        return [("All, in per cent", first), ("By size", sizes), ("By category", by_category)]

    def to_csv(self) -> str:
        """One row a detector, each size and each category; shares in per cent, empty where unknown."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(
            ["photos_are", "dataset", "detector", "threshold", "row", "name", "objects", "found", "false",
             "any_category", "ap50_%", "ap_%", "recall_%", "recall_low_%", "recall_high_%", "precision_%",
             "precision_low_%", "precision_high_%", "mask_ap50_%", "mask_ap_%", "ms_a_photo"]
        )  # fmt: skip
        kind = "synthetic" if self.synthetic else "real"
        for row in self.rows:
            threshold = "" if row.threshold is None else f"{row.threshold:g}"
            for what, name, own, (ap, ap50), (mask_ap, mask_ap50) in _parts(row, self.categories):
                shares = [ap50, ap, own.recall, *_ends(own.recall, own.recall_interval)]
                shares += [own.precision, *_ends(own.precision, own.precision_interval), mask_ap50, mask_ap]
                numbers = ["" if share is None else f"{100 * share:.3f}" for share in shares]
                counted = [str(n) for n in (own.objects, own.hits, own.false, own.placed)]
                ms = f"{row.ms:.1f}" if what == "total" else ""
                writer.writerow([kind, self.dataset, row.name, threshold, what, name, *counted, *numbers, ms])
        return out.getvalue()

    def to_json(self) -> dict[str, Any]:
        """One object; see docs/evaluation.md for its keys."""
        told: dict[str, Any] = {
            "title": self.title,
            "synthetic": self.synthetic,
            "dataset": self.dataset,
            "photos": self.photos,
            "objects": sum(self.categories.values()),
            "left_aside": self.aside,
            "smallest": self.smallest,
            "floor": self.floor,
            "notes": list(self.notes),
            "detectors": {},
        }
        for row in self.rows:
            figures: dict[str, Any] = {
                "threshold": row.threshold,
                "ms": row.ms,
                "photos_per_second": row.photos_per_second,
                "foreign": row.foreign,
                "sizes": {},
                "classes": {},
            }
            for what, name, own, (ap, ap50), (mask_ap, mask_ap50) in _parts(row, self.categories):
                one = _figures(own) | {"ap50": ap50, "ap": ap, "mask_ap50": mask_ap50, "mask_ap": mask_ap}
                if what == "total":
                    figures |= one
                else:
                    figures["sizes" if what == "size" else "classes"][name] = one
            told["detectors"][row.name] = figures
        return told


def detection_tables(
    outcomes: Sequence[PhotoOutcome],
    contestants: Sequence[Contestant],
    categories: Sequence[str],
    *,
    dataset: str,
    synthetic: bool = False,
    smallest: float = 32.0**2,
    notes: tuple[str, ...] = (),
) -> DetectionTables:
    """The tables of an evaluation.

    Args:
        outcomes: Every photo's.
        contestants: The detectors, in the order of their rows.
        categories: Those that count.
        dataset: What to call the data set.
        synthetic: The photos were drawn.
        smallest: Objects of fewer pixels² are neither to be found nor to be missed.
        notes: Sentences that the tables shall tell.

    Raises:
        DependencyError: pycocotools is not installed.
    """
    objects = dict.fromkeys(categories, 0)
    truth = [one for outcome in outcomes for one in outcome.truth]
    for one in truth:
        objects[one.category] += counts(one, smallest)
    rows = []
    for contestant in contestants:
        name = contestant.name
        parts: dict[tuple[str, str], Counts] = {}
        for outcome in outcomes:
            for key, more in count(outcome, name, smallest).items():
                parts[key] = parts.get(key, Counts()) + more
        answers = [outcome.answers[name] for outcome in outcomes]
        masked = any(one.mask is not None for one in truth) and any(
            one.mask is not None for answer in answers for one in answer.faint
        )
        rows.append(
            DetectorRow(
                name=name,
                threshold=contestant.threshold,
                total=sum(parts.values(), Counts()),
                by_category=_summed(parts, 0),
                by_size=_summed(parts, 1),
                boxes=average_precision(outcomes, name, categories, smallest),
                masks=average_precision(outcomes, name, categories, smallest, "segm") if masked else None,
                foreign=sum(len(answer.foreign) for answer in answers),
                seconds=tuple(answer.seconds for answer in answers),
            )
        )
    floors = [contestant.floor for contestant in contestants]
    return DetectionTables(
        dataset, synthetic, len(outcomes), objects, smallest, len(truth) - sum(objects.values()),
        min(floors, default=0.0), tuple(rows), notes,
    )  # fmt: skip


_Pair = tuple[float | None, float | None]


def _parts(row: DetectorRow, categories: Mapping[str, int]) -> list[tuple[str, str, Counts, _Pair, _Pair]]:
    """(kind, name, counts, AP and AP50 of the boxes, of the masks) of all, each size, each category."""
    none: _Pair = (None, None)
    masks = row.masks
    parts = [
        (
            "total", "all", row.total, (row.boxes.ap, row.boxes.ap50),
            none if masks is None else (masks.ap, masks.ap50),
        )
    ]  # fmt: skip
    for what, names, by, boxes, of_masks in (
        ("size", [name for name, *_ in SIZES], row.by_size, row.boxes.by_size, masks and masks.by_size),
        ("category", list(categories), row.by_category, row.boxes.by_category, masks and masks.by_category),
    ):
        parts += [
            (what, name, by.get(name, Counts()), boxes.get(name, none), (of_masks or {}).get(name, none))
            for name in names
        ]
    return parts


def _summed(parts: Mapping[tuple[str, str], Counts], place: int) -> dict[str, Counts]:
    told: dict[str, Counts] = {}
    for key, more in parts.items():
        told[key[place]] = told.get(key[place], Counts()) + more
    return told


def _figures(own: Counts) -> dict[str, Any]:
    return {
        "objects": own.objects,
        "found": own.hits,
        "false": own.false,
        "any_category": own.placed,
        "recall": own.recall,
        "recall_interval": None if own.recall is None else list(own.recall_interval),
        "precision": own.precision,
        "precision_interval": None if own.precision is None else list(own.precision_interval),
    }


def _ends(share: float | None, interval: tuple[float, float]) -> _Pair:
    return (None, None) if share is None else interval


def _rates(own: Counts) -> list[str]:
    """Recall and precision with their intervals."""
    return [
        "-" if share is None else f"{100 * share:.1f} [{100 * low:.1f}, {100 * high:.1f}]"
        for share, (low, high) in (
            (own.recall, own.recall_interval),
            (own.precision, own.precision_interval),
        )
    ]


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None


def _per_cent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f}"
