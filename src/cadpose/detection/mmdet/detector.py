"""DetectoRS as a detector: its COCO objects under the library's categories, with their masks."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from threading import Lock

import numpy as np

from cadpose.detection.coco import COCO_NAMES, is_living, votes
from cadpose.detection.mmdet import packages
from cadpose.detection.mmdet.model import Htc, Instances
from cadpose.detection.suppression import suppress
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_coco
from cadpose.records import Detection, Photo
from cadpose.weights import UNPUBLISHED, placed

#: Name of the checkpoint in :data:`cadpose.weights.UNPUBLISHED`.
WEIGHTS = "detectors-htc-r50"


class DetectorsDetector:
    """Finds objects and their masks with DetectoRS; see :mod:`cadpose.detection.mmdet.model`.

    Threads may share it and take turns.

    Args:
        categories: Library categories to keep; None keeps all but people and animals.
        device: ``"cpu"`` or ``"cuda"``.
        checkpoint: Weights; None takes those that a person has put in place, see :mod:`cadpose.weights`.
        min_score: Lowest score that is returned.
        scale: The photo is brought as large as fits these two sides; None takes the config's 1333 x 800.

    Raises:
        DependencyError: PyTorch, the device, OpenMMLab's packages or the weights are not there.
        InputError: the checkpoint is not one of this network.
    """

    name = "detectors"

    def __init__(
        self,
        categories: Collection[str] | None = None,
        device: str = "cpu",
        checkpoint: Path | None = None,
        *,
        min_score: float = 0.3,
        scale: tuple[int, int] | None = None,
    ) -> None:
        packages.require(device)
        # Before a minute goes into building what has no weights.
        path = checkpoint or placed(UNPUBLISHED[WEIGHTS])
        self.categories = None if categories is None else frozenset(categories)
        self.min_score = min_score
        self._turn = Lock()
        self._network = Htc(device, scale)
        self._network.load(path)

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections with masks of the photo's size, best first; a mask is None where no pixel is in it.

        Of several on one object the best is kept, see :func:`cadpose.detection.suppression.suppress`: the
        network's own suppression knows handbags and suitcases, which are one category here, as two classes.
        """
        wanted = [coco for coco in COCO_NAMES if self._named(coco, 1.0)]
        with self._turn:
            found = self._network.instances(photo.rgb, self.min_score, np.array(wanted, np.int64))
        named = [self._detection(found, i) for i in range(len(found))]
        return suppress(d for d in named if d is not None)

    def instances(self, photo: Photo, floor: float = 0.0) -> Instances:
        """What the network itself says, in COCO's 80 classes, people and animals among them."""
        with self._turn:
            return self._network.instances(photo.rgb, floor)

    def _detection(self, found: Instances, i: int) -> Detection | None:
        x0, y0, x1, y1 = found.boxes[i].tolist()
        named = self._named(int(found.classes[i]), float(found.scores[i]))
        if not named or named[0][1] < self.min_score or x1 <= x0 or y1 <= y0:
            return None
        (category, score), *others = named
        return Detection(
            box=Box(x0, y0, x1, y1),
            category=category,
            score=min(score, 1.0),
            mask=found.masks[i] if found.masks[i].any() else None,
            source=self.name,
            alternatives=tuple(others),
        )

    def _named(self, coco: int, score: float) -> list[tuple[str, float]]:
        """The wanted categories of a COCO class, best first; none where a library has nothing of the kind."""
        category = category_from_coco(COCO_NAMES[coco])
        if category is None or (self.categories is None and is_living(COCO_NAMES[coco])):
            return []
        named = votes(category, score).items()
        return [n for n in named if self.categories is None or n[0] in self.categories]
