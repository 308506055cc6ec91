"""A page of model pictures with their names, for looking a library over."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from cadpose.records import CadModel

_LINE = 15
_MARGIN = 4


def contact_sheet(
    entries: Sequence[tuple[CadModel, NDArray[np.uint8]]], columns: int = 6, title: str = ""
) -> Image.Image:
    """Pictures in rows, each with its model's name and the short form of its id.

    Args:
        entries: (model, (H, W, 3) uint8 picture); pictures may differ in size.
        columns: Pictures a row.
        title: A line above everything, if any.

    Raises:
        ValueError: no entry, no column, or a picture of another kind.
    """
    if not entries or columns < 1:
        raise ValueError("a contact sheet needs at least one entry and one column")
    for _, picture in entries:
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
            raise ValueError(f"a picture must be (H, W, 3) uint8, got {picture.shape} {picture.dtype}")
    columns = min(columns, len(entries))
    cell_width = max(p.shape[1] for _, p in entries) + 2 * _MARGIN
    cell_height = max(p.shape[0] for _, p in entries) + 2 * _LINE + 2 * _MARGIN
    top = _LINE + 2 * _MARGIN if title else 0
    rows = math.ceil(len(entries) / columns)
    sheet = Image.new("RGB", (cell_width * columns, top + cell_height * rows), "white")
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(size=11)
    if title:
        draw.text((_MARGIN, _MARGIN), title, fill="black", font=font)
    for number, (model, picture) in enumerate(entries):
        x = number % columns * cell_width + _MARGIN
        y = top + number // columns * cell_height + _MARGIN
        sheet.paste(Image.fromarray(np.ascontiguousarray(picture)), (x, y))
        y += cell_height - 2 * _LINE - 2 * _MARGIN
        width = cell_width - 2 * _MARGIN
        draw.text((x, y), _fitted(model.name, draw, font, width), fill="black", font=font)
        draw.text((x, y + _LINE - 2), _fitted(_short(model.id), draw, font, width), fill="grey", font=font)
    return sheet


def _short(cad_id: str) -> str:
    """The file's name without ending, or its folder where files are all called alike."""
    parts = cad_id.split("/")
    stem = parts[-1].rsplit(".", 1)[0]
    return parts[-2] if stem in ("model", "model_normalized") and len(parts) > 1 else stem


def _fitted(
    text: str, draw: ImageDraw.ImageDraw, font: ImageFont.ImageFont | ImageFont.FreeTypeFont, width: int
) -> str:
    if draw.textlength(text, font=font) <= width:
        return text
    while text and draw.textlength(text + "…", font=font) > width:
        text = text[:-1]
    return text + "…"
