"""The report of a detection evaluation: a page, a sheet of photos a detector, tables and every outcome."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from cadpose.annotations.page import jpeg_uri, page, text
from cadpose.annotations.parts import plain_text
from cadpose.annotations.style import jpeg_bytes
from cadpose.evaluation.detection import Found, PhotoOutcome, match
from cadpose.evaluation.detection_sheet import MOST, draw_sheet, worst_photos
from cadpose.evaluation.detection_tables import DetectionTables
from cadpose.library.storage import write_atomic

#: The page, and what lies beside it and every sheet.
PAGE, RESULTS, CSV, JSON = "report.html", "results.jsonl", "tables.csv", "tables.json"


def report_files(folder: Path, detectors: Sequence[str]) -> list[Path]:
    """Everything that a report writes: the page, outcomes, tables, and then a sheet a detector."""
    named = [re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:40] for name in detectors]
    sheets = [f"sheet-{number}-{name}.jpg" for number, name in enumerate(named, 1)]
    return [folder / name for name in (PAGE, RESULTS, CSV, JSON, *sheets)]


def write_detection_report(
    folder: Path,
    tables: DetectionTables,
    outcomes: Sequence[PhotoOutcome],
    facts: Mapping[str, str],
    progress: Callable[[], None] = lambda: None,
) -> Path:
    """Write the report; the page last.

    Args:
        folder: Made where it is missing; files of an earlier report are replaced.
        tables: What is told.
        outcomes: Every photo's.
        facts: Further facts for the page's head.
        progress: Told of each detector's sheet.

    Returns:
        The page's path.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    names = [row.name for row in tables.rows]
    told, results, as_csv, as_json, *sheets = report_files(folder, names)
    body = [f"<h1>{text(tables.title)}</h1><dl>"]
    for name, value in {**tables.facts(), **facts}.items():
        body.append(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>")
    body.append("</dl>")
    for caption, lines in tables.tables():
        body.append(f"<h2>{text(caption)}</h2>{html_table(lines)}")
    body += [f"<p>{text(sentence)}</p>" for sentence in tables.sentences()]
    for name, path in zip(names, sheets, strict=True):
        sheet = draw_sheet(worst_photos(outcomes, name, tables.smallest), name, tables.smallest)
        write_atomic(path, jpeg_bytes(sheet))
        body.append(
            f"<h2>{text(name)}: the worst {min(MOST, len(outcomes))} photos</h2>"
            "<p>Most missed objects and false detections first. Where a false one is right, the label is "
            "missing.</p>"
            f'<img class="sheet" alt="Found, missed and made up in photos" src="{jpeg_uri(sheet)}">'
        )
        progress()
    write_atomic(as_csv, tables.to_csv().encode("utf-8", "backslashreplace"))
    write_atomic(as_json, (json.dumps(tables.to_json(), indent=1, allow_nan=False) + "\n").encode())
    lines_told = (json.dumps(_entry(o, tables.smallest), allow_nan=False) for o in outcomes)
    write_atomic(results, "".join(f"{line}\n" for line in lines_told).encode())
    write_atomic(told, page(tables.title, "\n".join(body)).encode())
    return told


def html_table(lines: Sequence[Sequence[str] | None]) -> str:
    """Rows of cells, the first one the heads."""
    rows = [line for line in lines if line is not None]
    told = ""
    for tag, row in zip(("th", *["td"] * (len(rows) - 1)), rows, strict=True):
        told += "<tr>" + "".join(f"<{tag}>{text(cell)}</{tag}>" for cell in row) + "</tr>"
    return f"<table>{told}</table>"


def _entry(outcome: PhotoOutcome, smallest: float) -> dict[str, Any]:
    entry: dict[str, Any] = {
        "photo": plain_text(str(outcome.photo)),
        "objects": [
            {
                "category": one.category,
                "box": list(one.box.to_tuple()),
                "area": one.area,
                "crowd": one.crowd,
                "ignored": one.ignored,
            }
            for one in outcome.truth
        ],
        "detectors": {},
    }
    for name, answer in outcome.answers.items():
        matching = match(outcome.truth, answer.found, smallest, answer.foreign)
        entry["detectors"][name] = {
            "seconds": round(answer.seconds, 4),
            "missed": list(matching.missed),
            "found": [
                _told(one) | {"object": matching.hits.get(i), "false": i in matching.false}
                for i, one in enumerate(answer.found)
            ],
            "foreign": [_told(one) for one in answer.foreign],
        }
    return entry


def _told(one: Found) -> dict[str, Any]:
    box = [round(v, 2) for v in one.box.to_tuple()]
    return {"category": plain_text(one.category), "score": round(one.score, 4), "box": box}
