"""Retrieval among all models of a category: how often the true one is found, and how alike the answer is."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cadpose.datasets.labels import Label, object_in_photo
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.evaluation.shape_similarity import Shapes
from cadpose.evaluation.statistics import wilson_interval
from cadpose.geometry.boxes import Box
from cadpose.records import Photo, Rotation
from cadpose.similarity.index.drawn import DRAWN, DrawnRanking
from cadpose.similarity.index.library_index import LibraryIndex

#: Places that are counted.
PLACES = (1, 3, 10, 50)
#: So many models of a category at most tell how alike a model chosen by chance is.
_BY_CHANCE = 64


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """What came of one photo.

    Attributes:
        label: What is true.
        found: Ids of the models found, best first.
        among: How many models of the category there are.
        fscore, chamfer: How alike the first model found and the true one are.
        chance_fscore, chance_chamfer: The mean of the same over the models of the category, of a sample of
            64 where there are more.
        reason: Why there is no answer, or empty.
    """

    label: Label
    found: tuple[str, ...] = ()
    among: int = 0
    fscore: float = 0.0
    chamfer: float = 0.0
    chance_fscore: float = 0.0
    chance_chamfer: float = 0.0
    reason: str = ""

    @property
    def place(self) -> int | None:
        """1-based place of the true model, None where it is not among those found."""
        return self.found.index(self.label.cad) + 1 if self.label.cad in self.found else None


def search_labels(
    labels: Sequence[Label],
    index: LibraryIndex,
    models: Callable[[str], Sequence[str]],
    shapes: Shapes,
    rotations: Callable[[Label, Photo, Box], Sequence[Rotation]],
    *,
    rerank: bool = True,
    drawn: DrawnRanking | None = None,
    draw: int = DRAWN,
    seed: int = 0,
    done: Callable[[], None] = lambda: None,
) -> list[SearchOutcome]:
    """Look for the object of every label among all models of its category.

    Args:
        labels: Photo, category and true model each.
        index: Where it is looked for.
        models: Ids of a category's models in the index.
        shapes: Compares the answer with the true model.
        rotations: How the object may be turned.
        rerank: Rank by small maps too.
        drawn: Draws the best few and ranks them once more; left out if None.
        draw: How many are drawn.
        seed: Of the sample of models that stand for chance, the same for all photos of a category.
        done: Called after each photo.

    Raises:
        DependencyError: something is missing that every photo needs.
    """
    outcomes = []
    for label in labels:
        try:
            outcomes.append(_outcome(label, index, models, shapes, rotations, rerank, drawn, draw, seed))
        except DependencyError:
            raise
        except CadposeError as error:
            outcomes.append(SearchOutcome(label, reason=str(error)))
        done()
    return outcomes


def _outcome(
    label: Label,
    index: LibraryIndex,
    models: Callable[[str], Sequence[str]],
    shapes: Shapes,
    rotations: Callable[[Label, Photo, Box], Sequence[Rotation]],
    rerank: bool,
    drawn: DrawnRanking | None,
    draw: int,
    seed: int,
) -> SearchOutcome:
    photo, box = object_in_photo(label)
    true, others = str(label.cad), models(label.category)
    turned = rotations(label, photo, box)
    matches = index.query(
        photo.rgb,
        box,
        category=label.category,
        rotations=turned,
        top=PLACES[-1],
        rerank=rerank,
    )
    if not matches:
        return SearchOutcome(label, reason=f"the view index has no model of category {label.category!r}")
    if drawn is not None:
        matches = drawn.rank(matches, photo.rgb, box, turned, draw)
    if not matches:
        return SearchOutcome(label, reason="no model that was found can be drawn")
    answer = shapes.similarity(matches[0].cad, true)
    chance = [shapes.similarity(cad, true) for cad in _sample(others, label.category, seed)]
    return SearchOutcome(
        label,
        tuple(match.cad for match in matches),
        len(others),
        answer.fscore,
        answer.chamfer,
        float(np.mean([one.fscore for one in chance])),
        float(np.mean([one.chamfer for one in chance])),
    )


def _sample(models: Sequence[str], category: str, seed: int) -> list[str]:
    """The models that stand for chance."""
    if len(models) <= _BY_CHANCE:
        return list(models)
    rng = np.random.default_rng([seed, zlib.crc32(category.encode())])
    return [models[i] for i in sorted(rng.choice(len(models), _BY_CHANCE, replace=False))]


def search_table(outcomes: Sequence[SearchOutcome]) -> dict[str, Any]:
    """Figures a category and over all photos; rates are shares of the photos that were used.

    Each has ``photos``, ``models``, ``top1``, ``top3``, ``top10``, ``top50``, their ``chance`` and 95 %
    ``intervals``, ``fscore`` and ``chamfer`` of the answer, and both of a model chosen by chance.
    """
    used = [one for one in outcomes if not one.reason]
    categories = sorted({one.label.category for one in used})
    return {
        "categories": {
            name: _figures([one for one in used if one.label.category == name]) for name in categories
        },
        "all": _figures(used) if used else None,
        "rejected": len(outcomes) - len(used),
    }


def _figures(used: Sequence[SearchOutcome]) -> dict[str, Any]:
    n = len(used)
    hits = {k: sum(one.place is not None and one.place <= k for one in used) for k in PLACES}
    return {
        "photos": n,
        "models": float(np.mean([one.among for one in used])),
        **{f"top{k}": hits[k] / n for k in PLACES},
        "chance": {f"top{k}": float(np.mean([min(k / one.among, 1.0) for one in used])) for k in PLACES},
        "intervals": {f"top{k}": list(wilson_interval(hits[k], n)) for k in PLACES},
        "fscore": float(np.mean([one.fscore for one in used])),
        "chamfer": float(np.mean([one.chamfer for one in used])),
        "chance_fscore": float(np.mean([one.chance_fscore for one in used])),
        "chance_chamfer": float(np.mean([one.chance_chamfer for one in used])),
    }


def labelled_rotation(label: Label, photo: Photo, box: Box) -> list[Rotation]:
    """The true rotation.

    Raises:
        InputError: the label does not name it.
    """
    if label.rotation is None:
        raise InputError(f"{label.photo}: has no labelled rotation, use --rotation predicted")
    return [label.rotation]
