"""How a training goes: rows kept as JSON lines, and a picture of them."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from cadpose.library.storage import write_atomic

CURVES, PICTURE = "curves.jsonl", "curves.png"
Row = dict[str, Any]
_MEASURED = (
    ("acc30", "Acc@30"),
    ("macro30", "Acc@30, mean of categories"),
    ("acc10", "Acc@10"),
    ("match1", "model found by its embedding"),
    ("iou", "IoU of masks, mean"),
    ("median", "IoU of masks, median"),
    ("over90", "masks with an IoU of at least 0.9"),
)


class Curves:
    """The rows of one training; the file is whole after every one.

    Args:
        folder: Where ``curves.jsonl`` lies.
        step: Rows that were written up to this step are kept, later ones are of a run that was stopped; all
            if None.
    """

    def __init__(self, folder: Path, step: int | None = None) -> None:
        self.path = folder / CURVES
        self.rows: list[Row] = []
        if step != 0 and self.path.is_file():
            told = map(json.loads, self.path.read_text(encoding="utf-8").splitlines())
            self.rows = [row for row in told if step is None or row["step"] <= step]

    def add(self, row: Row) -> None:
        """Keep one more row; it has a ``step``, and replaces one of its kind and step."""
        kind = (row["step"], row.get("unseen"))
        self.rows = [r for r in self.rows if (r["step"], r.get("unseen")) != kind]
        self.rows.append(row)
        write_atomic(self.path, "".join(json.dumps(r) + "\n" for r in self.rows).encode("ascii"))

    def draw(self) -> Path | None:
        """Write ``curves.png`` beside the rows; None without matplotlib or with nothing to show."""
        if not self.rows or find_spec("matplotlib") is None:
            return None
        path = self.path.with_name(PICTURE)
        write_atomic(path, picture(self.rows))
        return path


def unseen_rows(rows: Sequence[Row]) -> list[Row]:
    """Those that tell of models never drawn in training."""
    return [row for row in rows if row.get("unseen")]


def picture(rows: Sequence[Row]) -> bytes:
    """PNG: losses above, accuracy on unseen models below, by step."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    seen, unseen = [row for row in rows if not row.get("unseen")], unseen_rows(rows)
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    above, below = figure.subplots(2, sharex=True)
    for name in ("loss", "pose", "head", "match"):
        told = [(row["step"], row[name]) for row in seen if name in row]
        if told:
            above.plot(*zip(*told, strict=True), label=name, lw=1.2)
    for name, label in _MEASURED:
        told = [(row["step"], 100.0 * row[name]) for row in unseen if name in row]
        if told:
            below.plot(*zip(*told, strict=True), "o-", label=label, lw=1.2, ms=3)
    above.set_ylabel("loss")
    below.set_ylabel("% of unseen models' objects")
    below.set_ylim(0, 100)
    below.set_xlabel("step")
    for axes in (above, below):
        axes.grid(alpha=0.3)
        if axes.get_lines():
            axes.legend(loc="best", fontsize=8)
    out = io.BytesIO()
    figure.savefig(out, format="png", dpi=130)
    return out.getvalue()
