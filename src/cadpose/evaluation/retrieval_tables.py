"""The tables of CAD retrieval in the shape of the paper's Tables 1 to 4, as text, CSV and JSON.

Shares are fractions of 1 in the records and in JSON, per cent in text and CSV. Brackets hold Wilson 95 %
intervals.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from cadpose.evaluation.rank_counts import Interval, RankCounts, Rates
from cadpose.evaluation.statistics import wilson_interval

#: Reasons of a stage that the text tells; all are in the JSON.
_MOST_REASONS = 5


@dataclass(frozen=True, slots=True)
class Certainty:
    """How far a measure's stated probabilities can be trusted, over the used photos.

    Attributes:
        threshold: Probability from which a photo was accepted where the measure had no flag of its own.
        ece: Expected calibration error over ten groups of equal size.
        brier: Brier score.
    """

    threshold: float
    ece: float
    brier: float


@dataclass(frozen=True, slots=True)
class Rejected:
    """Photos that left the way at one stage for one reason.

    Attributes:
        stage: ``"photo"``, ``"detection"``, ``"gallery"``, ``"pose"``, ``"review"`` or ``"ranking"``.
        reason: Why.
        photos: How many.
    """

    stage: str
    reason: str
    photos: int


@dataclass(frozen=True)
class MeasureTable:
    """One of Tables 1 to 3: a measure, a row a category.

    Attributes:
        measure: The measure's name.
        rows: One a category.
        total: All photos together.
        means: Macro means over categories and over true models.
        baselines: What chance, and knowing how frequent each model is, would give.
        rejected: Why photos are missing, the most frequent first.
        certainty: Where the measure states probabilities.
        note: What else has to be said of it.
        caption: What to call the table; "Measure NAME" unless told.
    """

    measure: str
    rows: tuple[RankCounts, ...]
    total: RankCounts
    means: tuple[Rates, ...] = ()
    baselines: tuple[Rates, ...] = ()
    rejected: tuple[Rejected, ...] = ()
    certainty: Certainty | None = None
    note: str = ""
    caption: str = ""

    def to_text(self) -> str:
        """The table in plain characters, with a line on the photos that are missing."""
        accepts = self.total.accepted is not None
        heads = ["Category", "Photos", "1st rank", "2nd rank", "3rd rank", "Top-3"]
        heads += ["Top-1 % [95 %]", "Top-3 % [95 %]", *(["Accepted", "Right %"] if accepts else [])]
        lines: list[list[str] | None] = [_counted(row, accepts) for row in self.rows]
        total = self.total
        lines.append(None)
        lines.append(_counted(total, accepts, "Total"))
        if rates := total.rates:
            lines.append(_rated(rates, "Success rate (%)"))
            spans = [wilson_interval(n, total.used) for n in (total.first, total.second, total.third)]
            lines.append(["95 % interval", "", *(_span(s) for s in (*spans, total.interval(3)))])
        if total.photos > total.used:
            n = total.photos
            whole = Rates("", total.first / n, total.second / n, total.third / n)
            lines.append(_rated(whole, "Of all photos (%)"))
        lines += [_rated(rates) for rates in (*self.means, *self.baselines)]
        out = [self.caption or f"Measure {self.measure}", aligned([heads, None, *lines])]
        share = f"{total.used / total.photos:.1%}" if total.photos else "-"
        out.append(f"Yield: {total.used} of {total.photos} photos ({share}){_reasons(self.rejected)}")
        if self.certainty is not None:
            c = self.certainty
            out.append(
                f"Accepted: first candidates with a probability of at least {c.threshold:g}, or not flagged "
                f"by the measure itself. ECE {c.ece:.3f}, Brier score {c.brier:.3f}"
            )
        if self.note:
            out.append(self.note)
        return "\n".join(out) + "\n"

    def to_json(self) -> dict[str, Any]:
        """`RankCounts.to_json` of all photos, with ``classes``, ``macro``, baselines and rejections."""
        told = self.total.to_json()
        told["classes"] = {row.name: row.to_json() for row in self.rows}
        told["macro"] = {rates.name: rates.to_json() for rates in self.means}
        told["baselines"] = {rates.name: rates.to_json() for rates in self.baselines}
        told["rejected"] = [{"stage": r.stage, "reason": r.reason, "photos": r.photos} for r in self.rejected]
        c = self.certainty
        told["certainty"] = c and {"threshold": c.threshold, "ece": c.ece, "brier": c.brier}
        return told


@dataclass(frozen=True)
class MethodTable:
    """Table 4's shape: one row a method, all categories together.

    Attributes:
        caption: What to call it.
        rows: One a method.
    """

    caption: str
    rows: tuple[RankCounts, ...]

    def to_text(self) -> str:
        """The table in plain characters."""
        heads = ["Method", "Used", "1st rank", "2nd rank", "3rd rank", "Top-3"]
        heads += ["Top-1 % [95 %]", "Top-3 % [95 %]", "Top-1 of all % [95 %]", "Top-3 of all % [95 %]"]
        lines = [
            [
                row.name,
                f"{row.used} of {row.photos}",
                *(str(n) for n in (row.first, row.second, row.third, row.top(3))),
                *(_share(row.rate(k), row.interval(k)) for k in (1, 3)),
                *(_share(row.end_to_end(k), row.end_to_end_interval(k)) for k in (1, 3)),
            ]
            for row in self.rows
        ]
        return f"{self.caption}\n{aligned([heads, None, *lines])}\n"

    def to_json(self) -> dict[str, Any]:
        """`RankCounts.to_json` by method."""
        return {row.name: row.to_json() for row in self.rows}


@dataclass(frozen=True)
class RetrievalTables:
    """Everything that one evaluation has to say; of real photos or of synthetic ones, never of both.

    Attributes:
        dataset: Name of the label file.
        synthetic: The photos were drawn.
        rotation: Where the rotation came from, in words.
        boxes: Where the boxes came from, in words.
        tables: One a measure, over the same photos.
        drawn_with: What drew synthetic photos, where known.
        within_30: (photos, photos in all) whose rotation was within 30 degrees of the labelled one.
        notes: Further sentences.
        beside: Tables published by others, to be shown beside and named as theirs.
    """

    dataset: str
    synthetic: bool
    rotation: str
    boxes: str
    tables: tuple[MeasureTable, ...]
    drawn_with: str = ""
    within_30: tuple[int, int] | None = None
    notes: tuple[str, ...] = ()
    beside: tuple[MeasureTable | MethodTable, ...] = field(default=(), repr=False)

    @property
    def title(self) -> str:
        """Says first whether the photos are real."""
        drawn = f" (drawn with {self.drawn_with})" if self.drawn_with else ""
        kind = f"SYNTHETIC photos{drawn}" if self.synthetic else "real photos"
        return f"CAD retrieval, {kind}: {self.dataset}"

    def facts(self) -> dict[str, str]:
        """What was evaluated, name to value."""
        facts = {"Photos": "synthetic" if self.synthetic else "real", "Boxes": self.boxes}
        if self.drawn_with:
            facts["Photos"] += f", drawn with {self.drawn_with}"
        facts["Rotation"] = self.rotation
        if self.within_30 is not None and self.within_30[1]:
            right, n = self.within_30
            low, high = wilson_interval(right, n)
            facts["Rotation within 30°"] = f"{right} of {n}: {right / n:.1%} [{low:.1%}, {high:.1%}]"
        return facts

    def comparison(self) -> MethodTable:
        """All measures side by side."""
        kind = "SYNTHETIC" if self.synthetic else "real"
        rows = tuple(replace(table.total, name=table.measure) for table in self.tables)
        return MethodTable(f"All measures, {kind} photos", rows)

    def to_text(self) -> str:
        """Title, facts, one table a measure, all measures side by side, and what others published."""
        parts = [self.title + "\n" + "\n".join(f"{name}: {told}" for name, told in self.facts().items())]
        parts += [table.to_text().rstrip("\n") for table in self.tables]
        if len(self.tables) > 1:
            parts.append(self.comparison().to_text().rstrip("\n"))
        parts += self.notes
        parts += [table.to_text().rstrip("\n") for table in self.beside]
        return "\n\n".join(parts) + "\n"

    def to_csv(self) -> str:
        """One row a category, total, mean or baseline of every measure; published ones under their name."""
        out = io.StringIO()
        columns = ["photos_are", "dataset", "measure", "row", "name", "photos", "used"]
        columns += ["rank1", "rank2", "rank3", "top3"]
        for what in ("top1", "top3", "all_top1", "all_top3"):
            columns += [f"{what}_%", f"{what}_low_%", f"{what}_high_%"]
        columns += ["accepted", "accepted_right"]
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(columns)
        kind = "synthetic" if self.synthetic else "real"
        for table in self.tables:
            writer.writerows([kind, self.dataset, *row] for row in _csv_rows(table))
        for other in self.beside:
            writer.writerows(["published", other.caption, *row] for row in _csv_rows(other))
        return out.getvalue()

    def to_json(self) -> dict[str, Any]:
        """One object; see docs/evaluation.md for its keys."""
        told: dict[str, Any] = {
            "title": self.title,
            "synthetic": self.synthetic,
            "dataset": self.dataset,
            "boxes": self.boxes,
            "rotation": self.rotation,
            "rotation_within_30": None if self.within_30 is None else list(self.within_30),
            "notes": list(self.notes),
            "measures": {table.measure: table.to_json() for table in self.tables},
        }
        if self.beside:
            told["published"] = {table.caption: table.to_json() for table in self.beside}
        return told


def aligned(lines: Sequence[Sequence[str] | None]) -> str:
    """Cells in columns, the first to the left and the others to the right; None draws a line."""
    rows = [line for line in lines if line is not None]
    widths = [max(len(row[i]) for row in rows if i < len(row)) for i in range(max(map(len, rows)))]
    out = []
    for line in lines:
        if line is None:
            out.append("-" * (sum(widths) + 2 * (len(widths) - 1)))
            continue
        cells = [cell.rjust(width) for cell, width in zip(line, widths, strict=False)]
        cells[0] = line[0].ljust(widths[0])
        out.append("  ".join(cells).rstrip())
    return "\n".join(out)


def _reasons(rejected: Sequence[Rejected]) -> str:
    """Rejections by stage, the most frequent reasons of each."""
    stages: dict[str, list[Rejected]] = {}
    for one in rejected:
        stages.setdefault(one.stage, []).append(one)
    told = []
    for stage, some in stages.items():
        reasons = [f"{one.reason} ({one.photos})" for one in some[:_MOST_REASONS]]
        more = [f"{len(some) - _MOST_REASONS} further reasons"] if len(some) > _MOST_REASONS else []
        told.append(f"\n  {stage} {sum(one.photos for one in some)}: {'; '.join([*reasons, *more])}")
    return f"; rejected at{''.join(told)}" if told else ""


def _counted(row: RankCounts, accepts: bool, name: str = "") -> list[str]:
    cells = [f"{name or row.name} ({row.used})", str(row.photos)]
    cells += [str(n) for n in (row.first, row.second, row.third, row.top(3))]
    cells += [_share(row.rate(k), row.interval(k)) for k in (1, 3)]
    if accepts:
        cells += ["-" if row.accepted is None else str(row.accepted)]
        cells += ["-" if row.precision is None else f"{100 * row.precision:.1f}"]
    return cells


def _rated(rates: Rates, name: str = "") -> list[str]:
    numbers = (rates.first, rates.second, rates.third, rates.top3)
    return [name or f"{rates.name[:1].upper()}{rates.name[1:]} (%)", "", *(f"{100 * n:.2f}" for n in numbers)]


def _share(value: float | None, interval: Interval | None) -> str:
    if value is None or interval is None:
        return "-"
    return f"{100 * value:.1f} [{100 * interval[0]:.1f}, {100 * interval[1]:.1f}]"


def _span(interval: Interval | None) -> str:
    return "-" if interval is None else f"{100 * interval[0]:.1f}-{100 * interval[1]:.1f}"


def _csv_rows(table: MeasureTable | MethodTable) -> list[list[str]]:
    """Measure, kind of row, name, and the numbers."""

    def shares(row: RankCounts) -> list[str]:
        told = [(row.rate(k), row.interval(k)) for k in (1, 3)]
        told += [(row.end_to_end(k), row.end_to_end_interval(k)) for k in (1, 3)]
        return [
            "" if number is None else f"{100 * number:.3f}"
            for value, interval in told
            for number in (value, *(interval or (None, None)))
        ]

    def counted(measure: str, kind: str, row: RankCounts) -> list[str]:
        counts = (row.photos, row.used, row.first, row.second, row.third, row.top(3))
        accepted = ["" if n is None else str(n) for n in (row.accepted, row.accepted_right)]
        return [measure, kind, row.name, *map(str, counts), *shares(row), *accepted]

    if isinstance(table, MethodTable):
        return [counted(row.name, "total", row) for row in table.rows]
    rows = [counted(table.measure, "category", row) for row in table.rows]
    rows.append(counted(table.measure, "total", table.total))
    for kind, some in (("mean", table.means), ("baseline", table.baselines)):
        for rates in some:
            per_cent = [f"{100 * rates.first:.3f}", "", "", f"{100 * rates.top3:.3f}", *[""] * 2]
            rows.append([table.measure, kind, rates.name, *[""] * 6, *per_cent, *[""] * 8])
    return rows
