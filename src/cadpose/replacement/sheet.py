"""The photo, the photo without its object, and the finished picture, side by side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.annotations.style import INK, PAPER, font, short
from cadpose.records import Photo
from cadpose.replacement.replacer import Replacement

_TILE, _GAP, _CAPTION = 480, 8, 22


def before_and_after(photo: Photo, replaced: Replacement) -> Image.Image:
    """A small sheet of three pictures, each at most 480 pixels a side."""
    name = replaced.cad.name or replaced.cad.id
    told = [
        ("photo", photo.rgb),
        ("object removed", replaced.background),
        (f"with {short(name, 40)}", replaced.picture),
    ]
    tiles = [(caption, _tile(rgb)) for caption, rgb in told]
    width = sum(tile.width for _, tile in tiles) + _GAP * (len(tiles) + 1)
    height = tiles[0][1].height + _CAPTION + _GAP
    sheet = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(sheet)
    left = _GAP
    for caption, tile in tiles:
        sheet.paste(tile, (left, _CAPTION))
        draw.text((left, 4), caption, fill=INK, font=font(13))
        left += tile.width + _GAP
    return sheet


def _tile(rgb: NDArray[np.uint8]) -> Image.Image:
    image = Image.fromarray(np.ascontiguousarray(rgb))
    image.thumbnail((_TILE, _TILE), Image.Resampling.LANCZOS)
    return image
