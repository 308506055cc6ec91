"""The SSD alone as a detector: its boxes and its classes, which nothing repairs; what others have to beat."""

from __future__ import annotations

from collections.abc import Collection

from cadpose.detection.coco import COCO_NAMES, is_living
from cadpose.detection.ssd import RawBoxes, Ssd
from cadpose.detection.suppression import suppress
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_coco
from cadpose.records import Detection, Photo


class SsdDetector:
    """SSD-MobileNetV2's boxes with the library category of their COCO class.

    Args:
        categories: Library categories to keep; None keeps all but people and animals.
        min_score: Lowest score that is returned.
        tiles: Also look at quarters of the photo, as the embedded detector does.
    """

    def __init__(
        self, categories: Collection[str] | None = None, min_score: float = 0.3, *, tiles: bool = False
    ) -> None:
        self.categories = None if categories is None else frozenset(categories)
        self.min_score = min_score
        self.tiles = tiles
        self.name = "ssd:tiles" if tiles else "ssd"
        self._ssd = Ssd()

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections, best first.

        Raises:
            DependencyError: the SSD's weights are missing or damaged.
        """
        return self._chosen(self._ssd.boxes(photo.rgb, floor=self.min_score, tiles=self.tiles))

    def _chosen(self, raw: RawBoxes) -> list[Detection]:
        found = []
        for box, coco, score in zip(raw.boxes, raw.classes, raw.scores, strict=True):
            name = COCO_NAMES.get(int(coco), "")
            category = category_from_coco(name)
            if category is None or (
                is_living(name) if self.categories is None else category not in self.categories
            ):
                continue
            found.append(Detection(Box(*box.tolist()), category, float(score), source=self.name))
        return suppress(found)
