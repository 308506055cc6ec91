"""The candidate strip: the photo's crop and the CAD candidates in rank order, one row an object."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw

from cadpose.annotations.style import (
    FAINT,
    INK,
    PAPER,
    TILE_PAPER,
    Colour,
    angles_text,
    colour_of,
    font,
    object_crop,
    short,
    standing_text,
    view_image,
)
from cadpose.records import Annotation, Photo, Views

#: Candidates drawn in a row.
LIMIT = 10

_TILE, _GAP, _CAPTION, _MARGIN = 176, 8, 40, 14


def draw_strips(photo: Photo, items: Sequence[tuple[Annotation, Views]]) -> Image.Image:
    """Draw one row for each annotation: crop, then candidates by rank with chance or score, and name.

    Args:
        photo: The photo.
        items: Each annotation with one view for each of its first candidates, in rank order and at the
            candidate's rotation; at most ``LIMIT`` are drawn.

    Returns:
        RGB picture; a note instead of rows where there are no annotations.

    Raises:
        ValueError: there are more views than candidates, or none.
    """
    columns = 1 + max((min(len(views), LIMIT) for _, views in items), default=1)
    width = 2 * _MARGIN + columns * _TILE + (columns - 1) * _GAP
    row = _TILE + _CAPTION
    height = 2 * _MARGIN + max(1, len(items)) * row + max(0, len(items) - 1) * _MARGIN
    image = Image.new("RGB", (width, height), PAPER)
    draw = ImageDraw.Draw(image)
    if not items:
        draw.text((_MARGIN, _MARGIN), "no object was annotated", fill=FAINT, font=font(16))
    for number, (annotation, views) in enumerate(items):
        _row(image, photo, annotation, views, _MARGIN + number * (row + _MARGIN), colour_of(number))
    return image


def _row(
    image: Image.Image, photo: Photo, annotation: Annotation, views: Views, top: int, colour: Colour
) -> None:
    if not 1 <= len(views) <= len(annotation.candidates):
        raise ValueError(f"{len(views)} views do not fit {len(annotation.candidates)} candidates")
    draw = ImageDraw.Draw(image)
    crop = object_crop(photo, annotation.detection.box, _TILE)
    _tile(image, crop, _MARGIN, top)
    category = short(annotation.detection.category, 20)
    _caption(draw, _MARGIN, top, f"{category} {annotation.detection.score:.2f}", angles_text(annotation.pose))
    for i, candidate in enumerate(annotation.candidates[: min(len(views), LIMIT)]):
        left = _MARGIN + (i + 1) * (_TILE + _GAP)
        _tile(image, view_image(views, i, _TILE - 8), left, top)
        if i == 0:
            draw.rectangle((left, top, left + _TILE - 1, top + _TILE - 1), outline=colour, width=4)
        told = standing_text(i + 1, candidate.score, candidate.probability)
        _caption(draw, left, top, told, candidate.cad.name)


def _tile(image: Image.Image, picture: Image.Image, left: int, top: int) -> None:
    image.paste(TILE_PAPER, (left, top, left + _TILE, top + _TILE))
    at = (left + (_TILE - picture.width) // 2, top + (_TILE - picture.height) // 2)
    image.paste(picture, at, picture if picture.mode == "RGBA" else None)


def _caption(draw: ImageDraw.ImageDraw, left: int, top: int, first: str, second: str) -> None:
    name = short(second, 60)
    while draw.textlength(name, font=font(13)) > _TILE - 2:
        name = short(name, len(name) - 1)
    draw.text((left + 1, top + _TILE + 4), first, fill=INK, font=font(14))
    draw.text((left + 1, top + _TILE + 21), name, fill=FAINT, font=font(13))
