"""The report of a mask evaluation: a page with tables and three sheets of outlines: worst, typical, best."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
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
from cadpose.evaluation.detection_report import html_table
from cadpose.evaluation.mask_tables import MaskTables
from cadpose.evaluation.masks import MaskOutcome
from cadpose.geometry.boxes import Box
from cadpose.library.storage import write_atomic
from cadpose.photos import read_photo
from cadpose.records import Mask

#: Objects of each sheet, and outlines of found masks.
MOST = 8
FOUND: Colour = (255, 128, 0)
PAGE, RESULTS, CSV, JSON, SHEETS = (
    "report.html", "results.jsonl", "tables.csv", "tables.json", ("worst.jpg", "typical.jpg", "best.jpg"),
)  # fmt: skip
_TILE, _GAP, _MARGIN, _HEAD, _FOOT = 230, 10, 16, 30, 20


def report_files(folder: Path) -> list[Path]:
    """Everything that a report writes."""
    return [folder / name for name in (PAGE, RESULTS, CSV, JSON, *SHEETS)]


def chosen(outcomes: Sequence[MaskOutcome], name: str, most: int = MOST) -> dict[str, list[MaskOutcome]]:
    """The worst, the typical (around the median) and the best by an estimator's IoU, no object twice."""
    ordered = sorted(outcomes, key=lambda o: (o.scores[name].iou, str(o.photo), o.box.to_tuple()))
    each = min(most, max(1, len(ordered) // 3))
    first = max(each, len(ordered) // 2 - each // 2)
    middle = ordered[first : first + each][: max(0, len(ordered) - each - first)]
    best = ordered[max(each, len(ordered) - each) :][::-1]
    return {"worst": ordered[:each], "typical": middle, "best": best}


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
    folder.mkdir(parents=True, exist_ok=True)
    told, results, as_csv, as_json, *sheets = report_files(folder)
    body = [f"<h1>{text(tables.title)}</h1><dl>"]
    for name, value in {**tables.facts(), **facts}.items():
        body.append(f"<dt>{text(name)}</dt><dd>{text(value)}</dd>")
    body.append("</dl>")
    for caption, lines in tables.tables():
        body.append(f"<h2>{text(caption)}</h2>{html_table(lines)}")
    body += [f"<p>{text(sentence)}</p>" for sentence in tables.sentences()]
    names = list(tables.total)
    for (caption, some), path in zip(chosen(outcomes, names[0]).items(), sheets, strict=True):
        sheet = draw_outlines(some, names)
        write_atomic(path, jpeg_bytes(sheet))
        body.append(
            f"<h2>{text(caption.capitalize())} by {text(names[0])}</h2>"
            f"<p>The true outline is green, the found one orange.</p>"
            f'<img class="sheet" alt="Outlines of masks" src="{jpeg_uri(sheet)}">'
        )
    write_atomic(as_csv, tables.to_csv().encode("utf-8", "backslashreplace"))
    write_atomic(as_json, (json.dumps(tables.to_json(), indent=1, allow_nan=False) + "\n").encode())
    write_atomic(results, "".join(_entry(outcome) for outcome in outcomes).encode())
    write_atomic(told, page(tables.title, "\n".join(body)).encode())
    return told


def draw_outlines(outcomes: Sequence[MaskOutcome], names: Sequence[str]) -> Image.Image:
    """An RGB sheet, a row of tiles an object: the crop, then one an estimator; two objects side by side."""
    columns = 2 if len(outcomes) > 1 else 1
    wide = (1 + len(names)) * (_TILE + _GAP)
    rows = max(1, -(-len(outcomes) // columns))
    tall = _TILE + _FOOT + _GAP
    size = (2 * _MARGIN + columns * wide + (columns - 1) * _MARGIN, 2 * _MARGIN + _HEAD + rows * tall)
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    x = float(_MARGIN)
    for words, colour in (("true", RIGHT), ("found", FOUND)):
        draw.text((x, _MARGIN - 4), words, fill=colour, font=font(17))
        x += draw.textlength(words, font=font(17)) + 20
    for i, outcome in enumerate(outcomes):
        row, column = divmod(i, columns)
        left, top = _MARGIN + column * (wide + _MARGIN), _MARGIN + _HEAD + row * tall
        crop, masks = _crop(outcome, names)
        captions = [short(f"{outcome.category} · {outcome.photo.name}", 36)]
        captions += [f"{n}: IoU {s.iou:.2f}, F {s.boundary:.2f}" for n in names for s in [outcome.scores[n]]]
        true = masks.pop(0)
        tiles = [_outlined(crop, true, None), *(_outlined(crop, true, mask) for mask in masks)]
        for tile, told in zip(tiles, captions, strict=True):
            sheet.paste(tile, (left + (_TILE - tile.width) // 2, top + (_TILE - tile.height) // 2))
            draw.text((left, top + _TILE + 3), told, fill=INK, font=font(12))
            left += _TILE + _GAP
    return sheet


def _crop(outcome: MaskOutcome, names: Sequence[str]) -> tuple[NDArray[np.uint8], list[NDArray[np.uint8]]]:
    """The photo around the box and all masks, and the true and each found mask there, at the tile's size."""
    masks = [_decoded(outcome.truth), *(_decoded(outcome.scores[name].mask) for name in names)]
    height, width = masks[0].shape
    around = Box.around(outcome.box, *(Box.from_mask(mask) for mask in masks)).scaled(1.15)
    around = around.clipped(width, height) or around
    x0, y0, x1, y1 = int(around.x0), int(around.y0), int(np.ceil(around.x1)), int(np.ceil(around.y1))
    scale = _TILE / max(x1 - x0, y1 - y0)
    size = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    try:
        rgb = resized(read_photo(outcome.photo).rgb[y0:y1, x0:x1], *size)
    except CadposeError:  # gone since: the outlines are shown all the same
        rgb = np.full((size[1], size[0], 3), FAINT, np.uint8)
    parts = [mask[y0:y1, x0:x1].astype(np.uint8) for mask in masks]
    return rgb, [
        np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_NEAREST), np.uint8) for part in parts
    ]


def _decoded(mask: RunLengths) -> Mask:
    return mask.decode()


def _outlined(
    rgb: NDArray[np.uint8], true: NDArray[np.uint8], found: NDArray[np.uint8] | None
) -> Image.Image:
    shown = np.ascontiguousarray(rgb)
    if found is not None:
        shown = shown.copy()
        for mask, colour in ((true, RIGHT), (found, FOUND)):
            contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
            cv2.drawContours(shown, contours, -1, colour, 1, cv2.LINE_AA)
    return Image.fromarray(shown)


def _entry(outcome: MaskOutcome) -> str:
    entry = {
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
    return json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n"
