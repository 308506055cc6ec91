"""The photos with the largest errors on one sheet: the crop, a model as estimated, the same as labelled."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
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
    object_crop,
    short,
    view_image,
)
from cadpose.datasets.label import Label
from cadpose.errors import CadposeError
from cadpose.evaluation.rotation import RotationResult
from cadpose.geometry.boxes import Box
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Photo, Rotation, Views

#: Photos on a sheet.
MOST = 24

_TILE, _GAP, _MARGIN, _TOP, _BOTTOM = 150, 6, 16, 24, 40


@dataclass(frozen=True, eq=False)
class Comparison:
    """One photo of the sheet.

    Attributes:
        result: The outcome.
        photo: The photo as it was shown to the estimator.
        box: The object's box in it.
        cad: The model that is drawn.
        views: Two views of it: at the estimated and at the true rotation.
    """

    result: RotationResult
    photo: Photo
    box: Box
    cad: CadModel
    views: Views


def worst_results(results: Sequence[RotationResult], count: int = MOST) -> list[RotationResult]:
    """Those with the largest errors, largest first; photos that failed have none and are left out."""
    scored = [r for r in results if np.isfinite(r.error)]
    return sorted(scored, key=lambda r: (-r.error, str(r.label.photo)))[:count]


def true_rotation(result: RotationResult) -> Rotation:
    """What is labelled; where that is the azimuth alone, the rest is taken from the estimate.

    Raises:
        ValueError: the outcome has no error.
    """
    label, estimate = result.label, result.estimate
    if label.rotation is not None:
        return label.rotation
    if label.azimuth is None or estimate is None:
        raise ValueError("neither labelled nor estimated")
    return Rotation(label.azimuth, estimate.elevation, estimate.inplane)


def compare(
    annotator: Annotator, result: RotationResult, seen: Callable[[Label], tuple[Photo, Box]]
) -> Comparison | None:
    """Draw the model most like the photo at the estimated rotation; None where nothing can be drawn.

    Args:
        annotator: Ranks and draws.
        result: An outcome with an estimate.
        seen: The photo and box that the estimator was shown.
    """
    if result.estimate is None:
        return None
    try:
        photo, box = seen(result.label)
        library = annotator.library
        pool = library.representatives(result.label.category, annotator.candidate_count)
        best = annotator.rank(photo, box, pool, [result.estimate])[0].cad
        R = np.stack([result.estimate.to_matrix(), true_rotation(result).to_matrix()])
        return Comparison(result, photo, box, best, annotator.render_framed(best, R))
    except CadposeError:
        # The evaluation has told of broken photos and models already; the sheet does without.
        return None


def draw_worst(comparisons: Sequence[Comparison], columns: int = 2) -> Image.Image:
    """An RGB sheet, row by row in the order given; a note where there is nothing to compare."""
    columns = max(1, min(columns, len(comparisons)))
    cell = 3 * _TILE + 2 * _GAP, _TOP + _TILE + _BOTTOM
    rows = max(1, -(-len(comparisons) // columns))
    size = (columns * cell[0] + (columns + 1) * _MARGIN, rows * cell[1] + (rows + 1) * _MARGIN)
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    if not comparisons:
        draw.text((_MARGIN, _MARGIN), "no photo to compare", fill=FAINT, font=font(15))
    for i, comparison in enumerate(comparisons):
        row, column = divmod(i, columns)
        left, top = _MARGIN + column * (cell[0] + _MARGIN), _MARGIN + row * (cell[1] + _MARGIN)
        _cell(sheet, draw, comparison, left, top)
    return sheet


def _cell(sheet: Image.Image, draw: ImageDraw.ImageDraw, comparison: Comparison, left: int, top: int) -> None:
    result = comparison.result
    colour = RIGHT if result.error <= 30.0 else WRONG
    draw.text((left, top), f"{result.error:.1f}°", fill=colour, font=font(17))
    certain = ""
    if result.hypotheses:
        first = result.hypotheses[0]
        certain = f"p {first.probability:.2f}"
        if first.expected_error is not None:
            certain += f", expected {first.expected_error:.0f}°"
        certain += " · needs review" if first.needs_review else ""
    draw.text((left + 72, top + 3), certain, fill=INK, font=font(13))
    assert result.estimate is not None
    label = result.label
    labelled = "label " + _angles(true_rotation(result))
    if label.rotation is None:
        labelled = f"label az {round(true_rotation(result).azimuth) % 360}°"
    tiles = (
        (object_crop(comparison.photo, comparison.box, _TILE, margin=0.0), label.photo.name, label.category),
        (_drawn(comparison, 0), "est. " + _angles(result.estimate), comparison.cad.name),
        (_drawn(comparison, 1), labelled, ""),
    )
    for i, (picture, first_line, second_line) in enumerate(tiles):
        x, y = left + i * (_TILE + _GAP), top + _TOP
        sheet.paste(TILE_PAPER, (x, y, x + _TILE, y + _TILE))
        at = (x + (_TILE - picture.width) // 2, y + (_TILE - picture.height) // 2)
        sheet.paste(picture, at, picture if picture.mode == "RGBA" else None)
        _line(draw, x, y + _TILE + 3, first_line, INK)
        _line(draw, x, y + _TILE + 19, second_line, FAINT)


def _drawn(comparison: Comparison, index: int) -> Image.Image:
    return view_image(comparison.views, index, _TILE - 10)


def _angles(rotation: Rotation) -> str:
    turn = f" ip {round(rotation.inplane)}°" if round(rotation.inplane) else ""
    return f"az {round(rotation.azimuth) % 360}° el {round(rotation.elevation)}°{turn}"


def _line(draw: ImageDraw.ImageDraw, x: int, y: int, words: str, colour: Colour) -> None:
    shown = short(words, 60)
    while shown and draw.textlength(shown, font=font(11)) > _TILE:
        shown = short(shown, len(shown) - 1)
    draw.text((x, y), shown, fill=colour, font=font(11))
