"""A report of outlines over their photos: tables, and sheets of the worst, the typical and the best."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.annotations.page import jpeg_uri, page, text
from cadpose.annotations.style import FAINT, INK, PAPER, RIGHT, Colour, font, jpeg_bytes, resized, short
from cadpose.errors import CadposeError
from cadpose.evaluation.detection_report import html_table
from cadpose.geometry.boxes import Box
from cadpose.library.storage import write_atomic
from cadpose.photos import read_photo
from cadpose.records import Mask

#: Objects of each sheet, and outlines of what is compared with the true one.
MOST = 8
FOUND: Colour = (255, 128, 0)
PAGE, RESULTS, CSV, JSON, SHEETS = (
    "report.html", "results.jsonl", "tables.csv", "tables.json", ("worst.jpg", "typical.jpg", "best.jpg"),
)  # fmt: skip
_TILE, _GAP, _MARGIN, _HEAD, _FOOT = 220, 10, 16, 30, 20

T = TypeVar("T")


class Tables(Protocol):
    """What a report tells in words and numbers."""

    @property
    def title(self) -> str:
        """Above everything."""
        ...

    def tables(self) -> list[tuple[str, list[list[str] | None]]]:
        """(caption, rows of cells) of each table, the first row its heads; None stands for a line."""
        ...

    def sentences(self) -> list[str]:
        """What is said below the tables."""
        ...

    def to_csv(self) -> str:
        """All tables."""
        ...

    def to_json(self) -> dict[str, Any]:
        """The same."""
        ...


@dataclass(frozen=True, eq=False)
class Outlined:
    """A row of a sheet: the crop of an object, and the crop again for each way of outlining it.

    Attributes:
        photo: The photo's file.
        category: Told with its name.
        box: The object's.
        true: Its true mask.
        found: What is told of each way, and its mask; None where it gave none.
    """

    photo: Path
    category: str
    box: Box
    true: Mask
    found: tuple[tuple[str, Mask | None], ...]


@dataclass(frozen=True)
class Sheet:
    """One sheet of a report.

    Attributes:
        caption: Above it.
        rows: What is on it.
    """

    caption: str
    rows: tuple[Outlined, ...]


def report_files(folder: Path) -> list[Path]:
    """Everything that a report writes."""
    return [folder / name for name in (PAGE, RESULTS, CSV, JSON, *SHEETS)]


def worst_typical_best(ordered: Sequence[T], most: int = MOST) -> dict[str, Sequence[T]]:
    """Of what is ordered from the worst on: the worst, those around the median, the best; none twice."""
    each = min(most, max(1, len(ordered) // 3))
    first = max(each, len(ordered) // 2 - each // 2)
    middle = ordered[first : first + each][: max(0, len(ordered) - each - first)]
    best = ordered[max(each, len(ordered) - each) :][::-1]
    return {"worst": ordered[:each], "typical": middle, "best": best}


def write_report(
    folder: Path,
    tables: Tables,
    facts: Mapping[str, str],
    results: Iterable[Mapping[str, Any]],
    sheets: Sequence[Sheet],
    legend: tuple[str, str],
) -> Path:
    """Write the report; the page last.

    Args:
        folder: Made where it is missing; files of an earlier report are replaced.
        tables: What is told.
        facts: The page's head.
        results: A line of JSON an object.
        sheets: Three.
        legend: What the true outline is called, and the other.

    Returns:
        The page's path.

    Raises:
        OSError: the folder or a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    told, lines_file, as_csv, as_json, *pictures = report_files(folder)
    body = [f"<h1>{text(tables.title)}</h1><dl>"]
    body += [f"<dt>{text(name)}</dt><dd>{text(value)}</dd>" for name, value in facts.items()]
    body.append("</dl>")
    body += [f"<h2>{text(caption)}</h2>{html_table(lines)}" for caption, lines in tables.tables()]
    body += [f"<p>{text(sentence)}</p>" for sentence in tables.sentences()]
    for sheet, path in zip(sheets, pictures, strict=True):
        picture = draw_outlines(sheet.rows, legend)
        write_atomic(path, jpeg_bytes(picture))
        body.append(
            f"<h2>{text(sheet.caption)}</h2>"
            f"<p>Outlines: {text(legend[0])} green, {text(legend[1])} orange.</p>"
            f'<img class="sheet" alt="Outlines over photos" src="{jpeg_uri(picture)}">'
        )
    entries = (json.dumps(entry, ensure_ascii=False, allow_nan=False) + "\n" for entry in results)
    write_atomic(as_csv, tables.to_csv().encode("utf-8", "backslashreplace"))
    write_atomic(as_json, (json.dumps(tables.to_json(), indent=1, allow_nan=False) + "\n").encode())
    write_atomic(lines_file, "".join(entries).encode())
    write_atomic(told, page(tables.title, "\n".join(body)).encode())
    return told


def draw_outlines(rows: Sequence[Outlined], legend: tuple[str, str]) -> Image.Image:
    """An RGB sheet, a row of tiles an object: the crop, then one a way; two objects side by side."""
    columns = 2 if len(rows) > 1 else 1
    wide = (1 + max((len(row.found) for row in rows), default=0)) * (_TILE + _GAP)
    tall = _TILE + _FOOT + _GAP
    height = 2 * _MARGIN + _HEAD + max(1, -(-len(rows) // columns)) * tall
    sheet = Image.new("RGB", (2 * _MARGIN + columns * wide + (columns - 1) * _MARGIN, height), PAPER)
    draw = ImageDraw.Draw(sheet)
    x = float(_MARGIN)
    for words, colour in zip(legend, (RIGHT, FOUND), strict=True):
        draw.text((x, _MARGIN - 4), words, fill=colour, font=font(17))
        x += draw.textlength(words, font=font(17)) + 20
    for i, row in enumerate(rows):
        line, column = divmod(i, columns)
        left, top = _MARGIN + column * (wide + _MARGIN), _MARGIN + _HEAD + line * tall
        crop, (true, *masks) = _crop(row)
        captions = [short(f"{row.category} · {row.photo.name}", 34), *(told for told, _ in row.found)]
        tiles = [Image.fromarray(crop), *(_with_outlines(crop, true, mask) for mask in masks)]
        for tile, caption in zip(tiles, captions, strict=True):
            sheet.paste(tile, (left + (_TILE - tile.width) // 2, top + (_TILE - tile.height) // 2))
            draw.text((left, top + _TILE + 3), caption, fill=INK, font=font(12))
            left += _TILE + _GAP
    return sheet


def _crop(row: Outlined) -> tuple[NDArray[np.uint8], list[NDArray[np.uint8]]]:
    """The photo around the box and all masks, and the true and each other mask there, at the tile's size."""
    masks = [row.true, *(np.zeros_like(row.true) if mask is None else mask for _, mask in row.found)]
    height, width = row.true.shape
    around = Box.around(row.box, *(Box.from_mask(mask) for mask in masks if mask.any())).scaled(1.15)
    around = around.clipped(width, height) or around
    x0, y0, x1, y1 = int(around.x0), int(around.y0), int(np.ceil(around.x1)), int(np.ceil(around.y1))
    scale = _TILE / max(x1 - x0, y1 - y0)
    size = max(1, round((x1 - x0) * scale)), max(1, round((y1 - y0) * scale))
    try:
        rgb = resized(read_photo(row.photo).rgb[y0:y1, x0:x1], *size)
    except CadposeError:  # gone since: the outlines are shown all the same
        rgb = np.full((size[1], size[0], 3), FAINT, np.uint8)
    parts = [mask[y0:y1, x0:x1].astype(np.uint8) for mask in masks]
    return np.ascontiguousarray(rgb), [
        np.asarray(cv2.resize(part, size, interpolation=cv2.INTER_NEAREST), np.uint8) for part in parts
    ]


def _with_outlines(rgb: NDArray[np.uint8], true: NDArray[np.uint8], found: NDArray[np.uint8]) -> Image.Image:
    shown = rgb.copy()
    for mask, colour in ((true, RIGHT), (found, FOUND)):
        contours, _ = cv2.findContours(mask, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(shown, contours, -1, colour, 1, cv2.LINE_AA)
    return Image.fromarray(shown)
