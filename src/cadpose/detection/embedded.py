"""The default detector: SSD-MobileNetV2 proposes boxes, EfficientNet-Lite0 repairs their classes.

The two err apart: the SSD finds a lamp and calls it an umbrella, Lite0 knows the lamp but not where it
is. So every box of the SSD, of whatever class, is a proposal; both networks vote on its category:

    F(c) = 1 - (1 - r D(c)) (1 - t L(c)),   t = TRUST sqrt(objectness)

D is the SSD's best score for the category among boxes on the same place, L is Lite0's probability on
the crop. A low L says little, since crops of busy scenes look like none of the 1000 classes; but where
Lite0 is sure of another category, r = 1 - TRUST max(0, 2 L(other) - 1) takes the SSD's word back. Where
Lite0 is sure of what the whole photo shows and no box was kept for it, the best of the SSD's faint boxes is.
Where nothing is left, what stands out is proposed all the same, its category unsure.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

import cv2
import numpy as np

from cadpose.detection.coco import COCO_NAMES, LIVING, VANS, votes
from cadpose.detection.imagenet import GREY, category_probabilities
from cadpose.detection.mask_network import NetworkMasks
from cadpose.detection.masks import MaskEstimator
from cadpose.detection.ssd import RawBoxes, Ssd
from cadpose.detection.suppression import share_inside, suppress
from cadpose.encoder import Lite0, lite0
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.frames import FloatArray
from cadpose.library.class_map import category_from_coco
from cadpose.photos import crop_square
from cadpose.records import Detection, Photo
from cadpose.threads import spread

#: How far Lite0's word counts against the SSD's.
TRUST = 0.8
#: Boxes of this overlap are one place.
SAME_PLACE = 0.6
#: Lowest score of the SSD that makes a proposal.
FLOOR = 0.08
#: Lowest score of the SSD that is read at all: faint boxes of any class still follow the edges of objects.
FAINT = 0.02
#: An object of this share of the photo's area is what the photo shows.
MAIN = 0.25
#: A box belongs to what another shows from this share of its area on, and is clear from this vote on.
HELD, CLEAR = 0.5, 0.3
#: Most proposals that Lite0 looks at.
MOST = 16
#: Lite0's probability on the whole photo above which an object is boxed that the SSD did not see, beside
#: others and where there are none.
SURE, ALONE = 0.5, 0.3
#: Cells a side in which windows add up to where an object is, and the share of the hottest that is object.
GRID, HOT = 48, 0.6
#: A place is narrowed to its mask's rectangle, but to no less than this share of it.
TIGHT = 0.1
#: A faint box of the SSD that overlaps that place so much is taken in its stead.
NEAR = 0.6
#: Detections from this score on are objects, by which it is decided whether others are looked for.
DECIDED = 0.3
#: A score of the SSD's that Lite0 does not share is forgotten below this, where Lite0 is sure of another.
FORGOTTEN = 0.5
#: An object of no sure category is proposed from this share of the photo's area on, and unless living things
#: fill the other share.
STANDS_OUT, LIVELY = 0.05, 0.25
#: Less than this is no word of Lite0 at all.
HINT = 0.05


@dataclass(slots=True)
class _Place:
    """Boxes of many classes on one place."""

    box: FloatArray
    votes: dict[str, float] = field(default_factory=dict)
    objectness: float = 0.0
    living: float = 0.0
    vans: float = 0.0


class EmbeddedDetector:
    """Finds objects with what the installed packages carry; needs no download.

    Args:
        categories: Library categories to keep; None keeps all.
        min_score: Lowest score that is returned; what Lite0 alone places, and proposals, may have less.
        tiles: Also look at quarters of the photo: finds smaller objects, takes five times as long.
        smallest: Boxes with a shorter side than this share of the photo's longer side are dropped.
        most: Largest number of detections a photo.
        propose: Where nothing is found, propose what stands out, its category unsure.
        encoder: Lite0; the process's shared one by default.
        masks: Narrows boxes that follow no edge; the shipped network by default.
    """

    name = "embedded"

    def __init__(
        self,
        categories: Collection[str] | None = None,
        *,
        min_score: float = DECIDED,
        tiles: bool = True,
        smallest: float = 0.03,
        most: int = 20,
        propose: bool = True,
        encoder: Lite0 | None = None,
        masks: MaskEstimator | None = None,
    ) -> None:
        self.categories = None if categories is None else frozenset(categories)
        self.min_score = min_score
        self.tiles = tiles
        self.smallest = smallest
        self.most = most
        self.propose = propose
        self.encoder = encoder or lite0()
        self.masks: MaskEstimator = masks or NetworkMasks(self.encoder.device)
        self._ssd = Ssd(self.encoder.device)

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections, best first.

        Raises:
            DependencyError: the SSD's weights are missing or damaged.
        """
        raw = self._ssd.boxes(photo.rgb, floor=FAINT, tiles=self.tiles)
        places = self._large_enough(_places(raw), photo)[:MOST]
        boxes = [Box(*p.box.tolist()) for p in places]
        seen = self._seen(photo, [*boxes, Box(0.0, 0.0, photo.width, photo.height)])
        found = []
        for place, box, probabilities in zip(places, boxes, seen[:-1], strict=True):
            if ranked := _fused(place, _own(place, probabilities, places), self.categories):
                found.append(_detection(box, ranked, self.name))
        kept = suppress([d for d in found if d.score >= DECIDED])
        for added in self._unboxed(photo, kept, raw, seen[-1]):
            kept = [d for d in kept if d.score >= FORGOTTEN or _iou(d.box, added.box) <= SAME_PLACE]
            kept.append(added)
        if not kept and self.propose:
            kept = self._standing_out(photo, raw, places, seen[-1])
        # What is decided above does not depend on how faint the detections are that are asked for.
        for d in suppress([d for d in found if self.min_score <= d.score < DECIDED]):
            if all(_iou(d.box, k.box) <= SAME_PLACE for k in kept):
                kept.append(d)
        kept = [d for d in kept if d.score >= self.min_score or d.score < DECIDED]
        return sorted(kept, key=lambda d: -d.score)[: self.most]

    def _large_enough(self, places: list[_Place], photo: Photo) -> list[_Place]:
        least = max(self.smallest * max(photo.width, photo.height), 8.0)
        return [p for p in places if (p.box[2:] - p.box[:2]).min() >= least]

    def _seen(self, photo: Photo, boxes: list[Box]) -> list[dict[str, float]]:
        """Lite0's category probabilities of each box."""
        crops = np.stack(spread(lambda box: crop_square(photo.rgb, box, fill=GREY), boxes))
        return category_probabilities(self.encoder.logits(crops))

    def _unboxed(
        self, photo: Photo, kept: list[Detection], raw: RawBoxes, whole: dict[str, float]
    ) -> list[Detection]:
        """The object that Lite0 is sure the photo shows, where nothing of its category was kept."""
        ranked = sorted(
            ((c, p) for c, p in whole.items() if self.categories is None or c in self.categories),
            key=lambda item: -item[1],
        )
        area = photo.width * photo.height
        if (
            not ranked
            or ranked[0][1] < (SURE if any(d.score >= FORGOTTEN for d in kept) else ALONE)
            or any(d.category == ranked[0][0] or (d.score > 0.5 and d.box.area > MAIN * area) for d in kept)
        ):
            return []
        category = ranked[0][0]
        box = self._where(photo, category)
        # The SSD's faint boxes follow edges, which windows do not.
        near = box_iou(raw.boxes, np.array(box.to_tuple())) if len(raw) else np.zeros(0)
        if near.max(initial=0.0) >= NEAR:
            boxes = [Box(*b.tolist()) for b in raw.boxes[near >= NEAR]][:MOST]
            box = boxes[int(np.argmax([p.get(category, 0.0) for p in self._seen(photo, boxes)]))]
        else:
            box = self._tightened(photo, box)
        return [_detection(box, [(c, TRUST * p) for c, p in ranked], self.name)]

    def _tightened(self, photo: Photo, box: Box) -> Box:
        """The rectangle of what the mask network sees in the box, unless that is next to nothing of it."""
        own = Box.from_mask(self.masks.mask(photo, box))
        return own if own.area >= TIGHT * box.area else box

    def _where(self, photo: Photo, category: str) -> Box:
        """Where the photo shows the category: windows slide over it, and what Lite0 says of them adds up."""
        box = Box(0.0, 0.0, photo.width, photo.height)
        windows = _windows(box)
        known = np.array([p.get(category, 0.0) for p in self._seen(photo, windows)])
        heat, seen = np.zeros((GRID, GRID)), np.full((GRID, GRID), 1e-9)
        scale = GRID / np.array([box.width, box.height])
        for window, p in zip(windows, known, strict=True):
            x0, y0 = np.floor(np.array([window.x0, window.y0]) * scale).astype(int)
            x1, y1 = np.ceil(np.array([window.x1, window.y1]) * scale).astype(int)
            heat[y0:y1, x0:x1] += p
            seen[y0:y1, x0:x1] += 1.0
        heat /= seen
        hot = heat >= HOT * heat.max()
        _, parts = cv2.connectedComponents(hot.astype(np.uint8), connectivity=4)
        own = Box.from_mask(np.asarray(parts == parts[np.unravel_index(heat.argmax(), heat.shape)]))
        corners = np.array(own.to_tuple()) / np.tile(scale, 2)
        return Box(*corners.tolist())

    def _standing_out(
        self, photo: Photo, raw: RawBoxes, places: list[_Place], whole: dict[str, float]
    ) -> list[Detection]:
        """What the SSD saw faintly, or the whole photo, as whatever of the library it looks most like."""
        area = float(photo.width * photo.height)
        living = [p.box for p in places if p.living > max(p.votes.values(), default=FLOOR)]
        if sum(_area(box) for box in living) > LIVELY * area:
            return []
        size = raw.boxes[:, 2:] - raw.boxes[:, :2]
        wanted = (size.prod(axis=1) >= STANDS_OUT * area) & ~np.isin(raw.classes, sorted(LIVING))
        worth = raw.scores * size.prod(axis=1) ** 0.25
        best = np.argsort(-np.where(wanted, worth, -1.0), kind="stable")[: int(wanted.any())]
        box, seen = Box(0.0, 0.0, photo.width, photo.height), whole
        if len(best):
            box = Box(*raw.boxes[best[0]].tolist())
            (seen,) = self._seen(photo, [box])
        # Lite0 names the box better than the photo: the photo's word breaks ties.
        said = {c: seen.get(c, 0.0) + 0.5 * whole.get(c, 0.0) for c in {*seen, *whole}}
        for i in best:
            if category := category_from_coco(COCO_NAMES.get(int(raw.classes[i]), "")):
                said[category] = said.get(category, 0.0) + float(raw.scores[i])
        ranked = sorted(
            ((c, p) for c, p in said.items() if self.categories is None or c in self.categories),
            key=lambda item: (-item[1], item[0]),
        )[:3]
        if not ranked or ranked[0][1] < FAINT:
            return []
        total = sum(p for _, p in ranked)
        told = [(c, 0.99 * DECIDED * p / total) for c, p in ranked]
        return [replace(_detection(box, told, self.name, least=0.0), unsure=True)]


def _own(place: _Place, seen: dict[str, float], places: list[_Place]) -> dict[str, float]:
    """Lite0's word on a place without what the SSD boxed within it: a bottle makes no bottle of its table."""
    own = dict(seen)
    for other in places:
        if other is not place and share_inside(other.box, place.box) > HELD:
            for category, vote in other.votes.items():
                if vote >= CLEAR and category not in place.votes:
                    own[category] = 0.0
    return own


def _fused(
    place: _Place, seen: dict[str, float], categories: Collection[str] | None
) -> list[tuple[str, float]]:
    """Both networks' word on a place: the wanted categories with their scores, best first."""
    trust = TRUST * float(np.sqrt(place.objectness)) * (1.0 - place.living)
    known, sure = max(seen.items(), key=lambda item: item[1])
    doubt = TRUST * max(0.0, 2.0 * sure - 1.0)
    fused = {}
    # COCO has no word for pickups and vans: Lite0 says which of its trucks and buses are cars.
    small = seen.get("car", 0.0) > max(seen.get("truck", 0.0), seen.get("bus", 0.0), HINT)
    for category in dict.fromkeys([*place.votes, *seen]):
        if categories is None or category in categories:
            vote = place.votes.get(category, 0.0) * (1.0 if category == known else 1.0 - doubt)
            if category == "car" and small:
                vote = max(vote, place.vans)
            fused[category] = 1.0 - (1.0 - vote) * (1.0 - trust * seen.get(category, 0.0))
    return sorted(fused.items(), key=lambda item: -item[1])


def _windows(box: Box) -> list[Box]:
    """Squares of three sizes that slide over the box by a third of themselves, faster over a long one."""
    found = []
    for share in (0.35, 0.5, 0.7):
        side = share * min(box.width, box.height)
        across, down = (
            min(max(int(np.ceil((n - side) / side * 3.0)) + 1, 2), MOST) for n in (box.width, box.height)
        )
        for x in np.linspace(box.x0, box.x1 - side, across):
            found += [Box(x, y, x + side, y + side) for y in np.linspace(box.y0, box.y1 - side, down)]
    return found


def _iou(a: Box, b: Box) -> float:
    return float(box_iou(np.array(a.to_tuple()), np.array(b.to_tuple())))


def _detection(box: Box, ranked: list[tuple[str, float]], source: str, least: float = 0.05) -> Detection:
    (category, score), others = ranked[0], ranked[1:4]
    return Detection(
        box=box,
        category=category,
        score=float(min(score, 1.0)),
        source=source,
        alternatives=tuple((c, float(s)) for c, s in others if s >= least),
    )


def _places(raw: RawBoxes) -> list[_Place]:
    """Boxes gathered by overlap across classes, best first; the best box of a place stands for it."""
    places: list[_Place] = []
    boxes = np.empty((len(raw), 4))
    for i in np.argsort(-raw.scores, kind="stable"):
        score, box, coco = float(raw.scores[i]), raw.boxes[i], int(raw.classes[i])
        near = box_iou(boxes[: len(places)], box)
        if len(near) and near.max() >= SAME_PLACE:
            place = places[int(near.argmax())]
        elif score >= FLOOR:
            boxes[len(places)] = box
            place = _Place(box=box)
            places.append(place)
        else:
            continue
        place.objectness = max(place.objectness, score)
        if coco in LIVING:
            place.living = max(place.living, score)
        elif category := category_from_coco(COCO_NAMES.get(coco, "")):
            if category in VANS:
                place.vans = max(place.vans, score)
            for name, vote in votes(category, score).items():
                place.votes[name] = max(place.votes.get(name, 0.0), vote)
    # Large places with a category first: Lite0 looks at a limited number.
    return sorted(places, key=lambda p: -max([p.objectness / 2, *p.votes.values()]) * _area(p.box) ** 0.25)


def _area(box: FloatArray) -> float:
    return float((box[2:] - box[:2]).prod())
