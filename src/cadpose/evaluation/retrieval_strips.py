"""Examples of a ranking: the photo's crop and the first candidates, the true one marked."""

from __future__ import annotations

from collections.abc import Sequence
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
    font,
    object_crop,
    short,
    view_image,
)
from cadpose.datasets.labels import object_in_photo
from cadpose.errors import CadposeError
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.retrieval import Outcome
from cadpose.geometry.boxes import Box
from cadpose.pipeline import Annotator
from cadpose.records import Candidate, Photo, Views

#: Candidates of a strip; the true one follows where it is not among them.
SHOWN = 5

_TILE, _GAP, _MARGIN, _BOTTOM, _FRAME = 132, 6, 8, 38, 4


@dataclass(frozen=True, eq=False)
class Strip:
    """One photo with the candidates that are drawn.

    Attributes:
        photo: The photo.
        box: The object's box in it.
        cad: The true model.
        shown: (place, candidate) of those that are drawn, the first places first.
        views: One render each, at the candidate's own rotation.
        probability: What the ranker said of its first candidate, None if nothing.
    """

    photo: Photo
    box: Box
    cad: str
    shown: tuple[tuple[int, Candidate], ...]
    views: Views
    probability: float | None = None


def examples(
    outcomes: Sequence[Outcome], name: str, good: int, bad: int
) -> tuple[list[Outcome], list[Outcome]]:
    """Photos to show of one measure: right ones, and wrong ones with the true model's worst places first.

    Both go round the categories, so that the most frequent one does not fill the page.

    Args:
        outcomes: Every photo's.
        name: The measure.
        good: At most so many right ones, those with a middling lead over the second, which are typical.
        bad: At most so many wrong ones.
    """
    ranked = [o for o in outcomes if isinstance(o.answers[name], Ranking)]
    right = [o for o in ranked if o.place(name) == 1]
    leads = [_lead(o, name) for o in right]
    middle = float(np.median(leads)) if leads else 0.0
    typical = [right[i] for i in np.argsort([abs(lead - middle) for lead in leads], kind="stable")]
    wrong = [o for o in ranked if o.place(name) != 1]
    # A true model that is no candidate comes first of all.
    worst = sorted(wrong, key=lambda o: -(o.place(name) or float("inf")))
    return _round(typical)[:good], _round(worst)[:bad]


def strip_of(annotator: Annotator, outcome: Outcome, name: str) -> Strip | None:
    """Read the photo again and draw the candidates; None where that fails."""
    answer = outcome.answers[name]
    if not isinstance(answer, Ranking) or outcome.box is None or outcome.label.cad is None:
        return None
    numbered = list(enumerate(answer.candidates, 1))
    shown = numbered[:SHOWN]
    shown += [pair for pair in numbered[SHOWN:] if pair[1].cad.id == outcome.label.cad]
    try:
        photo, _ = object_in_photo(outcome.label)
        views = [annotator.render_framed(c.cad, c.rotation.to_matrix()[None]) for _, c in shown]
    except CadposeError:
        # The evaluation has told of broken photos and models already; the page does without.
        return None
    return Strip(photo, outcome.box, outcome.label.cad, tuple(shown), Views.joined(views), answer.probability)


def draw_strip(strip: Strip) -> Image.Image:
    """An RGB picture of one row: the crop, then the candidates with place, score and name.

    The true model has a green frame; the first candidate has a red one where it is another.
    """
    columns = 2 + SHOWN
    size = (2 * _MARGIN + columns * (_TILE + _GAP) - _GAP, 2 * _MARGIN + _TILE + _BOTTOM)
    picture = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(picture)
    crop = object_crop(strip.photo, strip.box, _TILE, margin=0.0)
    sure = "" if strip.probability is None else f"p = {strip.probability:.2f}"
    _tile(picture, draw, 0, crop, strip.photo.name.replace("\\", "/").rsplit("/", 1)[-1], sure)
    for i, (place, candidate) in enumerate(strip.shown):
        view = view_image(strip.views, i, _TILE - 10)
        score = f"{candidate.score:.0f}" if abs(candidate.score) >= 100 else f"{candidate.score:.3g}"
        _tile(picture, draw, i + 1, view, f"{place}   {score}", candidate.cad.name)
        true = candidate.cad.id == strip.cad
        if true or place == 1:
            left = _MARGIN + (i + 1) * (_TILE + _GAP)
            corners = (left, _MARGIN, left + _TILE - 1, _MARGIN + _TILE - 1)
            draw.rectangle(corners, outline=RIGHT if true else WRONG, width=_FRAME)
    return picture


def _lead(outcome: Outcome, name: str) -> float:
    """Score of the first candidate less that of the second."""
    answer = outcome.answers[name]
    assert isinstance(answer, Ranking)
    scores = [candidate.score for candidate in answer.candidates[:2]]
    return scores[0] - scores[1] if len(scores) > 1 else 0.0


def _round(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """In order, the first of each category before the second of any."""
    seen: dict[str, int] = {}
    turns = []
    for outcome in outcomes:
        category = outcome.label.category
        turns.append(seen.setdefault(category, 0))
        seen[category] += 1
    return [outcomes[i] for i in np.argsort(turns, kind="stable")]


def _tile(
    picture: Image.Image,
    draw: ImageDraw.ImageDraw,
    column: int,
    shown: Image.Image,
    first: str,
    second: str,
) -> None:
    left, top = _MARGIN + column * (_TILE + _GAP), _MARGIN
    picture.paste(TILE_PAPER, (left, top, left + _TILE, top + _TILE))
    at = (left + (_TILE - shown.width) // 2, top + (_TILE - shown.height) // 2)
    picture.paste(shown, at, shown if shown.mode == "RGBA" else None)
    for line, (words, colour) in enumerate(((first, INK), (second, FAINT))):
        name = short(words, 60)
        while name and draw.textlength(name, font=font(11)) > _TILE:
            name = short(name, len(name) - 1)
        draw.text((left, top + _TILE + 3 + 16 * line), name, fill=colour, font=font(11))
