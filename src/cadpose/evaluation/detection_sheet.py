"""Photos with what a detector found, missed and made up, drawn in three colours; the worst first."""

from __future__ import annotations

from collections.abc import Sequence

from PIL import Image, ImageDraw

from cadpose.annotations.style import (
    FAINT,
    INK,
    PAPER,
    RIGHT,
    TILE_PAPER,
    WRONG,
    Colour,
    font,
    resized,
    short,
)
from cadpose.errors import CadposeError
from cadpose.evaluation.detection import Matching, PhotoOutcome, counts, match
from cadpose.geometry.boxes import Box
from cadpose.photos import read_photo

#: Photos on a sheet.
MOST = 24
#: An object that no detection shows.
MISSED: Colour = (0, 120, 230)
_TILE, _GAP, _MARGIN, _HEAD, _FOOT = 320, 12, 16, 30, 22


def worst_photos(
    outcomes: Sequence[PhotoOutcome], detector: str, smallest: float, most: int = MOST
) -> list[PhotoOutcome]:
    """Those with the most missed objects and false detections together, the worst first."""

    def faults(outcome: PhotoOutcome) -> int:
        matching = _matching(outcome, detector, smallest)
        return len(matching.missed) + len(matching.false)

    return sorted(outcomes, key=lambda o: (-faults(o), str(o.photo)))[:most]


def draw_sheet(
    outcomes: Sequence[PhotoOutcome], detector: str, smallest: float, columns: int = 4
) -> Image.Image:
    """An RGB sheet, row by row in the order given; photos that cannot be read any more are grey.

    Args:
        outcomes: Which photos, see `worst_photos`.
        detector: Whose detections.
        smallest: As in the evaluation.
        columns: Photos a row.
    """
    columns = max(1, min(columns, len(outcomes)))
    rows = max(1, -(-len(outcomes) // columns))
    cell = _TILE + _GAP, _TILE + _FOOT + _GAP
    sheet = Image.new(
        "RGB", (2 * _MARGIN + columns * cell[0] - _GAP, 2 * _MARGIN + _HEAD + rows * cell[1] - _GAP), PAPER
    )
    draw = ImageDraw.Draw(sheet)
    x = float(_MARGIN)
    legend = ((detector, INK), ("found", RIGHT), ("missed", MISSED), ("false", WRONG), ("left aside", FAINT))
    for words, colour in legend:
        draw.text((x, _MARGIN - 2), words, fill=colour, font=font(17))
        x += draw.textlength(words, font=font(17)) + 22
    for i, outcome in enumerate(outcomes):
        row, column = divmod(i, columns)
        _cell(
            sheet, draw, outcome, detector, smallest,
            (_MARGIN + column * cell[0], _MARGIN + _HEAD + row * cell[1]),
        )  # fmt: skip
    return sheet


def _matching(outcome: PhotoOutcome, detector: str, smallest: float) -> Matching:
    answer = outcome.answers[detector]
    return match(outcome.truth, answer.found, smallest, answer.foreign)


def _cell(
    sheet: Image.Image,
    draw: ImageDraw.ImageDraw,
    outcome: PhotoOutcome,
    detector: str,
    smallest: float,
    at: tuple[int, int],
) -> None:
    x, y = at
    sheet.paste(TILE_PAPER, (x, y, x + _TILE, y + _TILE))
    matching = _matching(outcome, detector, smallest)
    picture = _picture(outcome, detector, smallest, matching)
    sheet.paste(picture, (x + (_TILE - picture.width) // 2, y + (_TILE - picture.height) // 2))
    told = f"{len(matching.hits)} found, {len(matching.missed)} missed, {len(matching.false)} false"
    draw.text((x, y + _TILE + 4), f"{short(outcome.photo.name, 22)}: {told}", fill=INK, font=font(12))


def _picture(outcome: PhotoOutcome, detector: str, smallest: float, matching: Matching) -> Image.Image:
    """The photo at the tile's size with its boxes."""
    width, height = outcome.size
    scale = _TILE / max(width, height)
    size = max(1, round(width * scale)), max(1, round(height * scale))
    try:
        picture = Image.fromarray(resized(read_photo(outcome.photo).rgb, *size))
    except CadposeError:
        picture = Image.new("RGB", size, FAINT)
    draw = ImageDraw.Draw(picture)
    found = outcome.answers[detector].found
    missed = set(matching.missed)
    for j, one in enumerate(outcome.truth):
        if not counts(one, smallest):
            _box(draw, one.box, scale, FAINT, "", 1)
        elif j in missed:
            _box(draw, one.box, scale, MISSED, one.category, 2)
    for numbers, colour in ((matching.false, WRONG), (tuple(matching.hits), RIGHT)):
        for i in numbers:
            _box(draw, found[i].box, scale, colour, f"{found[i].category} {found[i].score:.2f}", 2)
    return picture


def _box(draw: ImageDraw.ImageDraw, box: Box, scale: float, colour: Colour, words: str, line: int) -> None:
    x0, y0, x1, y1 = (value * scale for value in box.to_tuple())
    draw.rectangle((x0, y0, max(x1 - 1, x0), max(y1 - 1, y0)), outline=colour, width=line)
    if words:
        label, small = f" {short(words, 22)} ", font(11)
        wide = draw.textlength(label, font=small)
        left, top = max(0.0, min(x0, _TILE - wide)), max(0.0, y0 - 13 if y0 >= 13 else y0)
        draw.rectangle((left, top, left + wide, top + 13), fill=colour)
        draw.text((left, top), label, fill=PAPER, font=small)
