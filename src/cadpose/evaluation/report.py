"""The report of a rotation evaluation: a page, its pictures beside it, and every photo's outcome as JSONL."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from cadpose.annotations.page import data_uri, jpeg_uri, page, text
from cadpose.annotations.parts import plain_text
from cadpose.annotations.style import png_bytes
from cadpose.errors import InputError
from cadpose.evaluation import figures
from cadpose.evaluation.confidence import Answers
from cadpose.evaluation.rotation import RotationResult
from cadpose.evaluation.worst import Comparison, draw_worst
from cadpose.library.storage import write_atomic
from cadpose.records import Rotation

#: Everything that a report may write into its folder.
FILES = (
    "report.html", "results.jsonl", "worst.png",
    "reliability.png", "errors.png", "azimuth.png", "curves.png", "risk.png",
)  # fmt: skip
#: Failures that the page lists; all are in results.jsonl.
_MOST_FAILURES = 50


def prepare_report(folder: Path, inputs: Iterable[Path]) -> None:
    """Make the folder and see that the report can be written, before a long evaluation.

    Raises:
        DependencyError: matplotlib is not installed.
        InputError: the report would be written over one of the inputs.
        OSError: the folder cannot be made.
    """
    figures.require_matplotlib()
    folder.mkdir(parents=True, exist_ok=True)
    ours = {os.path.realpath(folder / name) for name in FILES}
    for path in inputs:
        if os.path.realpath(path) in ours:
            raise InputError(f"{path} would be written over by the report: choose another folder")


def results_jsonl(results: Sequence[RotationResult]) -> str:
    """One JSON object a line for each photo, in order.

    Keys: ``photo``, ``category``, ``box`` [x0, y0, x1, y1] or null as labelled, ``truth`` (``azimuth``,
    ``elevation``, ``inplane``, null where not labelled; of the turned photo where it was turned),
    ``hypotheses`` (angles, ``score``, ``probability``, ``expected_error``, ``needs_review``, ``error``),
    ``error`` and ``azimuth_error`` of the first hypothesis in degrees, ``flagged``, ``reason``. What a photo
    that failed does not have is null.
    """
    return "".join(json.dumps(_entry(r), ensure_ascii=False, allow_nan=False) + "\n" for r in results)


def write_report(
    folder: Path,
    results: Sequence[RotationResult],
    table: Mapping[str, Any],
    worst: Sequence[Comparison],
    facts: Mapping[str, str],
) -> Path:
    """Write ``report.html``, ``results.jsonl`` and the pictures that the page shows inline; the page last.

    Args:
        folder: Made where it is missing; files of an earlier report are replaced.
        results: Every photo's outcome.
        table: From `rotation_table`, with the `confidence_figures`.
        worst: What to draw on the sheet, in order.
        facts: What was evaluated, name to value, for the page's head.

    Returns:
        The page's path.

    Raises:
        DependencyError: matplotlib is not installed.
        OSError: the folder or a file cannot be written.
    """
    answers = Answers.of(results)
    charts: dict[str, tuple[bytes, str]] = {}
    if len(answers):
        stated = "" if answers.calibrated else " The estimator's probabilities are shares, not calibrated."
        charts = {
            "reliability.png": (
                figures.reliability_diagram(answers),
                "On the diagonal, eight of ten answers with a probability of 0.8 are within 30°. Points "
                "below it: too sure of itself. ECE is the mean gap over ten groups of equal size." + stated,
            ),
            "errors.png": (
                figures.error_histogram(answers),
                "Photos by error; neither axis is linear. A second heap near 180° is made of objects taken "
                "for facing the other way.",
            ),
            "azimuth.png": (
                figures.azimuth_confusion(results),
                "True against estimated azimuth. Right answers lie on the diagonal, half turns on the "
                "dotted lines.",
            ),
            "curves.png": (
                figures.error_curves(results),
                "The share of photos whose error is below a value, by category.",
            ),
            "risk.png": (
                figures.risk_coverage_curve(answers),
                "The share of wrong answers when only the most probable are kept. The lower, the better the "
                "probability tells right from wrong; the point is the review flag's.",
            ),
        }
    sheet = draw_worst(worst)
    write_atomic(folder / "results.jsonl", results_jsonl(results).encode())
    for name, (data, _) in charts.items():
        write_atomic(folder / name, data)
    write_atomic(folder / "worst.png", png_bytes(sheet))
    path = folder / "report.html"
    write_atomic(path, _html(results, table, charts, sheet if worst else None, facts).encode())
    return path


def _html(
    results: Sequence[RotationResult],
    table: Mapping[str, Any],
    charts: Mapping[str, tuple[bytes, str]],
    sheet: Image.Image | None,
    facts: Mapping[str, str],
) -> str:
    body = ["<h1>Rotation</h1><dl>"]
    body += [f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in facts.items() if value]
    body += ["</dl>", _table(table)]
    if charts:
        body.append('<h2>Diagrams</h2><div class="charts">')
        body += [
            f'<figure><img alt="{text(name)}" src="{data_uri("png", data)}">'
            f"<figcaption>{text(caption)}</figcaption></figure>"
            for name, (data, caption) in charts.items()
        ]
        body.append("</div>")
    if sheet is not None:
        body.append(
            "<h2>Largest errors</h2><p>The crop, the model that looks most like it at the estimated "
            "rotation, and the same model at the labelled one. Where the right picture is turned unlike the "
            "crop, look at the label.</p>"
            f'<img class="sheet" alt="Photos with the largest errors" src="{jpeg_uri(sheet)}">'
        )
    failed = [r for r in results if r.reason]
    if failed:
        body.append(f"<h2>Without an answer: {len(failed)}</h2><dl>")
        body += [
            f"<dt>{text(r.label.photo.name)}</dt><dd>{text(r.reason)}</dd>" for r in failed[:_MOST_FAILURES]
        ]
        body.append("</dl>")
    return page("Rotation evaluation", "\n".join(body))


def _table(table: Mapping[str, Any]) -> str:
    columns = ("photos", "yield", "Acc@30", "95 %", "best of 5", "Acc@10", "MedErr", "flips")
    rows = [("category", *columns)]
    for name, row in [*table["classes"].items(), ("all", table)]:
        span = row["acc30_interval"]
        rows.append(
            (
                name,
                str(row["n"]),
                _share(row["yield"]),
                _share(row["acc30"]),
                "–" if span is None else f"{span[0]:.1%} to {span[1]:.1%}",
                _share(row["acc30_top5"]),
                _share(row["acc10"]),
                "–" if row["mederr"] is None else f"{row['mederr']:.1f}°",
                _share(row["flips"]),
            )
        )
    cells = [
        "".join(f"<{tag}>{text(cell)}</{tag}>" for cell in row)
        for tag, row in zip(("th", *["td"] * (len(rows) - 1)), rows, strict=True)
    ]
    told = ""
    if table["ece"] is not None:
        kept = f"{table['coverage_unflagged']:.0%} of the answers are not flagged for review"
        if not table["calibrated"]:
            kept = "The probabilities are shares and nothing is flagged"
        elif table["precision_unflagged"] is not None:
            kept += f", {table['precision_unflagged']:.1%} of them within 30°"
        told = f"<p>ECE {table['ece']:.3f}, Brier score {table['brier']:.3f}. {kept}.</p>"
    return "<table>" + "".join(f"<tr>{row}</tr>" for row in cells) + f"</table>{told}"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{value:.1%}"


def _entry(result: RotationResult) -> dict[str, Any]:
    label = result.label
    return {
        "photo": plain_text(str(label.photo)),
        "category": plain_text(label.category),
        "box": None if label.box is None else label.box.to_tuple(),
        "truth": {"azimuth": label.azimuth, "elevation": label.elevation, "inplane": label.inplane},
        "hypotheses": [
            {
                **_angles(hypothesis.rotation),
                "score": hypothesis.score,
                "probability": hypothesis.probability,
                "expected_error": hypothesis.expected_error,
                "needs_review": hypothesis.needs_review,
                "error": error,
            }
            for hypothesis, error in zip(result.hypotheses, result.hypothesis_errors, strict=True)
        ],
        "error": result.error if np.isfinite(result.error) else None,
        "azimuth_error": result.azimuth_error if np.isfinite(result.azimuth_error) else None,
        "flagged": result.hypotheses[0].needs_review if result.hypotheses else None,
        "reason": plain_text(result.reason) or None,
    }


def _angles(rotation: Rotation) -> dict[str, float]:
    return {"azimuth": rotation.azimuth, "elevation": rotation.elevation, "inplane": rotation.inplane}
