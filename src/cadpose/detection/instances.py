"""What a network with classes of its own found, to detections with library categories."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.detection.canvas import Canvas
from cadpose.detection.coco import COCO_NAMES, is_living, votes
from cadpose.detection.onnx_head import Suppression
from cadpose.detection.reading import most_masks
from cadpose.detection.suppression import suppress
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.library.class_map import category_from_coco, category_from_name
from cadpose.records import Detection, Mask

#: Gives the i-th instance's (h, w) float map, above 0 inside the object, spread evenly over the canvas.
MaskOf = Callable[[int], NDArray[np.float32]]

#: Other categories of an object are told from this score on, and so many of them.
ALTERNATIVE, ALTERNATIVES = 0.05, 3
#: Most candidates that are compared with one another, the best first.
MOST_COMPARED = 300

_COCO = frozenset(COCO_NAMES.values())


@dataclass(frozen=True, eq=False)
class Instances:
    """N objects in a network's input.

    Attributes:
        boxes: (N, 4) x0, y0, x1, y1 in pixels of the canvas.
        scores: (N, C) in [0, 1], a column a class.
        mask_of: Gives the objects' maps, None where there are none.
        crop: Masks end at their boxes.

    Raises:
        ValueError: boxes and scores differ in length.
    """

    boxes: FloatArray
    scores: FloatArray
    mask_of: MaskOf | None = None
    crop: bool = False

    def __post_init__(self) -> None:
        if self.scores.ndim != 2 or self.boxes.shape != (len(self.scores), 4):
            raise ValueError(f"Instances: boxes {self.boxes.shape} and scores {self.scores.shape} do not fit")


def class_categories(names: Sequence[str], categories: Collection[str] | None) -> tuple[str | None, ...]:
    """The library category of each class of a network, None for what is ignored.

    Ignored are empty names, people, animals and food, and COCO's classes that have no library category,
    unless ``categories`` has them by name. Other names that the class map lacks stay as they are.
    """
    out: list[str | None] = []
    for name in names:
        word = name.strip().lower()
        category = category_from_coco(word) or category_from_name(word)
        asked = categories is not None and (category or word) in categories
        ignored = is_living(word) or (category is None and word in _COCO)
        out.append(None if not word or (ignored and not asked) else category or word)
    return tuple(out)


def detections(
    found: Instances,
    canvas: Canvas,
    classes: Sequence[str | None],
    wanted: Collection[str] | None,
    *,
    min_score: float,
    suppression: Suppression | None,
    most: int,
    source: str,
    vans: bool = False,
) -> list[Detection]:
    """Detections in photo pixels, best first.

    An object whose best class is ignored is left out, however good its next one. Classes of one category
    count as the best of them, and an object's other categories become its alternatives.

    Args:
        found: What the network found.
        canvas: Where the photo lay in its input.
        classes: A category for each class, from :func:`class_categories`.
        wanted: Categories that are kept; None keeps all.
        min_score: Lowest score that is kept.
        suppression: How repeats are dropped.
        most: Largest number of detections; fewer where their masks would not fit in ``MAX_MASK_BYTES``.
        source: What made them.
        vans: Buses and trucks count as cars by half, since COCO files vans and pickups under them.

    Raises:
        OutputError: masks are no numbers.
    """
    boxes = canvas.to_photo(found.boxes)
    kept: list[tuple[int, Detection]] = []
    for i in np.argsort(-found.scores.max(axis=1, initial=0.0), kind="stable"):
        if len(kept) == MOST_COMPARED:
            break
        box = _box(boxes[i], canvas.photo)
        ranked = _ranked(found.scores[i], classes, wanted, vans)
        if box is not None and ranked and ranked[0][1] >= min_score:
            (category, score), others = ranked[0], ranked[1 : 1 + ALTERNATIVES]
            alternatives = tuple((c, s) for c, s in others if s >= ALTERNATIVE)
            kept.append((int(i), Detection(box, category, score, source=source, alternatives=alternatives)))
    query = {d: i for i, d in kept}
    best = sorted((d for _, d in kept), key=lambda d: -d.score)
    if suppression is not None:
        across = suppression.iou if suppression.across_classes else 1.0
        best = suppress(best, across=across, within=suppression.iou, inside=1.0)
    if found.mask_of is not None:
        most = min(most, most_masks(*canvas.photo))
    return [_with_mask(d, query[d], found, canvas) for d in best[:most]]


def _ranked(
    scores: FloatArray, classes: Sequence[str | None], wanted: Collection[str] | None, vans: bool
) -> list[tuple[str, float]]:
    """Wanted categories of an object with their scores, best first; empty where its best class is ignored."""
    if classes[int(scores.argmax())] is None:
        return []
    best: dict[str, float] = {}
    for i in np.flatnonzero(scores > 0.0).tolist():
        category, score = classes[i], float(scores[i])
        if category is not None:
            for name, vote in (votes(category, score) if vans else {category: score}).items():
                best[name] = max(best.get(name, 0.0), vote)
    kept = [(c, s) for c, s in best.items() if wanted is None or c in wanted]
    return sorted(kept, key=lambda item: -item[1])


def _box(corners: FloatArray, photo: tuple[int, int]) -> Box | None:
    """The part of a box inside the photo, None where it is thinner than a pixel."""
    x0, y0, x1, y1 = corners.tolist()
    if x1 <= x0 or y1 <= y0:
        return None
    box = Box(x0, y0, x1, y1).clipped(*photo)
    return box if box is not None and min(box.width, box.height) >= 1.0 else None


def _with_mask(detection: Detection, i: int, found: Instances, canvas: Canvas) -> Detection:
    """The detection with its mask of the photo's size; without one where the network's is empty."""
    if found.mask_of is None:
        return detection
    mask = canvas.mask(found.mask_of(i))
    if found.crop:
        mask = _cropped(mask, detection.box)
    return replace(detection, mask=mask) if mask.any() else detection


def _cropped(mask: Mask, box: Box) -> Mask:
    """The mask's pixels whose middles lie in the box."""
    x0, y0, x1, y1 = (int(v) for v in np.ceil(np.array(box.to_tuple()) - 0.5))
    out = np.zeros_like(mask)
    out[y0:y1, x0:x1] = mask[y0:y1, x0:x1]
    return out
