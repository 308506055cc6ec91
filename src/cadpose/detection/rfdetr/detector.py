"""RF-DETR-Seg as a detector: boxes, COCO's classes and masks from one network."""

from __future__ import annotations

from collections.abc import Collection
from functools import cached_property
from threading import Lock
from typing import Any

from cadpose.detection.canvas import Canvas, network_input
from cadpose.detection.decode import OutputError, head_detections
from cadpose.detection.instances import class_categories
from cadpose.detection.rfdetr.checkpoint import read_checkpoint
from cadpose.detection.rfdetr.network import build, configuration, require_transformers, run
from cadpose.detection.rfdetr.sizes import SIZES, head_of
from cadpose.errors import DependencyError, InputError
from cadpose.records import Detection, Photo
from cadpose.weights import UNPUBLISHED, placed


class RfDetrDetector:
    """Finds objects with RF-DETR-Seg, trained on COCO.

    Source: Robinson, Robicheaux, Popov, Ramanan, Peri, "RF-DETR: Neural Architecture Search for Real-Time
    Detection Transformers", 2025; weights of Roboflow's package. The weights are put in place by hand.

    Args:
        size: ``"n"``, ``"s"``, ``"m"``, ``"l"``, ``"xl"`` or ``"2xl"``.
        categories: Library categories to keep; None keeps all but people, animals and food.
        device: ``"cpu"`` or ``"cuda"``.
        min_score: Lowest score that is returned.

    Raises:
        InputError: there is no such size.
        DependencyError: the packages, the device or the weights are not there.
    """

    def __init__(
        self,
        size: str = "s",
        categories: Collection[str] | None = None,
        device: str = "cpu",
        min_score: float = 0.3,
    ) -> None:
        if size not in SIZES:
            raise InputError(f"RF-DETR has no size {size}: choose one of {', '.join(SIZES)}.")
        self.size = SIZES[size]
        self.name = f"rfdetr:{size}"
        self.categories = None if categories is None else frozenset(categories)
        self.device = device
        self.min_score = min_score
        self._turn = Lock()
        self._head = head_of(self.size.side, self.size.weights)
        self._classes = class_categories(self._head.class_names, self.categories)
        require_transformers(device)
        self._file = placed(UNPUBLISHED[self.size.weights])

    @cached_property
    def _network(self) -> Any:
        return build(configuration(self.size), read_checkpoint(self._file, self.size.queries), self.device)

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections with masks of the photo's size, best first.

        Raises:
            DependencyError: the weights are not those of this size.
        """
        head = self._head
        canvas = Canvas.of(photo.width, photo.height, head.input)
        with self._turn:  # the network is loaded once
            network = self._network
        outputs = run(network, network_input(photo.rgb, canvas, head.input), self.device)
        try:
            return head_detections(
                head, outputs, canvas, self._classes, self.categories, self.min_score, "rfdetr"
            )
        except OutputError as error:
            raise DependencyError(f"{self._file} is damaged: the network {error}") from None
