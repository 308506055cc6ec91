"""The report of an alignment evaluation: a page with tables, and sheets of worst, typical and best."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.annotations.page import jpeg_uri, page, text
from cadpose.annotations.parts import plain_text
from cadpose.annotations.style import FAINT, INK, PAPER, RIGHT, Colour, font, jpeg_bytes, resized, short
from cadpose.datasets.label import RunLengths
from cadpose.errors import CadposeError
from cadpose.evaluation.alignment import AlignmentOutcome
from cadpose.evaluation.alignment_tables import AlignmentTables
from cadpose.evaluation.detection_report import html_table
from cadpose.geometry.boxes import Box
from cadpose.library.storage import write_atomic
from cadpose.photos import read_photo

#: Objects of each sheet, and outlines of models.
MOST = 8
MODEL: Colour = (255, 128, 0)
PAGE, RESULTS, CSV, JSON, SHEETS = (
    "report.html", "results.jsonl", "tables.csv", "tables.json", ("worst.jpg", "typical.jpg", "best.jpg"),
)  # fmt: skip
_TILE, _GAP, _MARGIN, _HEAD, _FOOT = 220, 10, 16, 30, 20


def report_files(folder: Path) -> list[Path]:
    """Everything that a report writes."""
    return [folder / name for name in (PAGE, RESULTS, CSV, JSON, *SHEETS)]


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
    folder.mkdir(parents=True, exist_ok=True)
    told, results, as_csv, as_json, *sheets = report_files(folder)
    body = [f"<h1>{text(tables.title)}</h1><dl>"]
    body += [f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in tables.facts.items()]
    body.append("</dl>")
    body += [f"<h2>{text(caption)}</h2>{html_table(lines)}" for caption, lines in tables.tables()]
    body += [f"<p>{text(sentence)}</p>" for sentence in tables.sentences()]
    names = list(tables.total)
    by = [name for name in names if all(name in outcome.scores for outcome in outcomes)]
    way = by[min(1, len(by) - 1)]
    ordered = sorted(outcomes, key=lambda o: (o.scores[way].silhouette_iou, str(o.label.photo)))
    each = min(MOST, max(1, len(ordered) // 3))
    middle = len(ordered) // 2 - each // 2
    chosen = (ordered[:each], ordered[middle : middle + each], ordered[-each:][::-1])
    for caption, some, path in zip(("Worst", "Typical", "Best"), chosen, sheets, strict=True):
        sheet = draw_placed(some, names)
        write_atomic(path, jpeg_bytes(sheet))
        body.append(
            f"<h2>{caption} by silhouette IoU of {text(way)}</h2>"
            f"<p>The mask's outline is green, the model's orange.</p>"
            f'<img class="sheet" alt="Outlines of placed models" src="{jpeg_uri(sheet)}">'
        )
    write_atomic(as_csv, tables.to_csv().encode("utf-8", "backslashreplace"))
    write_atomic(as_json, (json.dumps(tables.to_json(), indent=1, allow_nan=False) + "\n").encode())
    write_atomic(results, "".join(_entry(outcome) for outcome in outcomes).encode())
    write_atomic(told, page(tables.title, "\n".join(body)).encode())
    return told


def draw_placed(outcomes: Sequence[AlignmentOutcome], names: Sequence[str]) -> Image.Image:
    """An RGB sheet, a row of tiles an object: the crop, then one a way; two objects side by side."""
    columns = 2 if len(outcomes) > 1 else 1
    wide = (1 + len(names)) * (_TILE + _GAP)
    rows, tall = max(1, -(-len(outcomes) // columns)), _TILE + _FOOT + _GAP
    size = (2 * _MARGIN + columns * wide + (columns - 1) * _MARGIN, 2 * _MARGIN + _HEAD + rows * tall)
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    x = float(_MARGIN)
    for words, colour in (("mask", RIGHT), ("model", MODEL)):
        draw.text((x, _MARGIN - 4), words, fill=colour, font=font(17))
        x += draw.textlength(words, font=font(17)) + 20
    for i, outcome in enumerate(outcomes):
        row, column = divmod(i, columns)
        left, top = _MARGIN + column * (wide + _MARGIN), _MARGIN + _HEAD + row * tall
        rgb, (true, *silhouettes) = _crop(outcome, names)
        tiles = [_outlined(rgb, true, None)]
        captions = [short(f"{outcome.label.category} · {outcome.label.photo.name}", 34)]
        for name, silhouette in zip(names, silhouettes, strict=True):
            score = outcome.scores.get(name)
            tiles.append(_outlined(rgb, true, silhouette))
            told = "" if score is None else f": IoU {score.silhouette_iou:.2f}, {score.rotation_error:.0f}°"
            captions.append(f"{name}{told}")
        for tile, caption in zip(tiles, captions, strict=True):
            sheet.paste(tile, (left + (_TILE - tile.width) // 2, top + (_TILE - tile.height) // 2))
            draw.text((left, top + _TILE + 3), caption, fill=INK, font=font(12))
            left += _TILE + _GAP
    return sheet


def _crop(
    outcome: AlignmentOutcome, names: Sequence[str]
) -> tuple[NDArray[np.uint8], list[NDArray[np.uint8]]]:
    """The photo around the box, and the mask and each way's silhouette there, at the tile's size."""
    empty = RunLengths(outcome.truth.size, (outcome.truth.size[0] * outcome.truth.size[1],))
    masks = [m.decode() for m in (outcome.truth, *(outcome.outlines.get(n, empty) for n in names))]
    height, width = masks[0].shape
    around = Box.around(outcome.box, *(Box.from_mask(m) for m in masks if m.any())).scaled(1.1)
    around = around.clipped(width, height) or around
    x0, y0, x1, y1 = int(around.x0), int(around.y0), int(np.ceil(around.x1)), int(np.ceil(around.y1))
    scale = _TILE / max(x1 - x0, y1 - y0)
    size = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    try:
        rgb = resized(read_photo(outcome.label.photo).rgb[y0:y1, x0:x1], *size)
    except CadposeError:  # gone since: the outlines are shown all the same
        rgb = np.full((size[1], size[0], 3), FAINT, np.uint8)
    parts = [mask[y0:y1, x0:x1].astype(np.uint8) for mask in masks]
    return rgb, [
        np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_NEAREST), np.uint8) for part in parts
    ]


def _outlined(
    rgb: NDArray[np.uint8], true: NDArray[np.uint8], model: NDArray[np.uint8] | None
) -> Image.Image:
    shown = np.ascontiguousarray(rgb)
    if model is not None:
        shown = shown.copy()
        for mask, colour in ((true, RIGHT), (model, MODEL)):
            contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            cv2.drawContours(shown, contours, -1, colour, 1, cv2.LINE_AA)
    return Image.fromarray(shown)


def _entry(outcome: AlignmentOutcome) -> str:
    entry = {
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
    return json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n"
