"""SSD-MobileNetV2 trained on COCO: boxes with COCO classes, on the photo and on tiles of it.

The frozen graph of the TensorFlow model zoo comes inside a PyPI package whose metadata names no licence;
it is used from there and never copied.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.detection.ssd_boxes import decode
from cadpose.detection.ssd_graph import ENCODINGS, IMAGES, SCORES, SsdGraph, read_graph
from cadpose.errors import DependencyError
from cadpose.geometry.frames import FloatArray
from cadpose.onnx_session import open_session
from cadpose.threads import spread
from cadpose.weights import ensure

#: What the network's session is called.
NAME = "ssd-mobilenet-v2"
#: Side of the square that the network sees; the picture is stretched into it, as in training.
SIDE = 300
#: Tiles, as (x0, y0, x1, y1) in shares of the photo: four quarters that overlap by a third.
QUARTERS = ((0.0, 0.0, 0.6, 0.6), (0.4, 0.0, 1.0, 0.6), (0.0, 0.4, 0.6, 1.0), (0.4, 0.4, 1.0, 1.0))
#: A box this near to a border inside the photo, in shares of the tile, is taken for a cut object.
CUT = 0.03

#: (300, 300, 3) uint8 RGB and the lowest score to (N, 6) class, score, x0, y0, x1, y1 in shares of it.
Network = Callable[[NDArray[np.uint8], float], FloatArray]


@dataclass(frozen=True, eq=False)
class RawBoxes:
    """N boxes as the network gave them.

    Attributes:
        boxes: (N, 4) x0, y0, x1, y1 in continuous pixels, inside the photo.
        classes: (N,) COCO ids, see :data:`cadpose.detection.coco.COCO_NAMES`.
        scores: (N,) in [0, 1].
    """

    boxes: FloatArray
    classes: NDArray[np.int64]
    scores: FloatArray

    def __post_init__(self) -> None:
        n = len(self.scores)
        if self.boxes.shape != (n, 4) or self.classes.shape != (n,) or self.scores.shape != (n,):
            raise ValueError("RawBoxes: boxes, classes and scores differ in length")

    def __len__(self) -> int:
        return len(self.scores)


def ssd_graph() -> SsdGraph:
    """The installed weights as an ONNX network.

    Raises:
        DependencyError: they are missing or damaged.
    """
    frozen, text = ensure("ssd-mobilenet-v2-coco"), ensure("ssd-mobilenet-v2-coco-graph")
    try:
        return read_graph(frozen.read_bytes(), text.read_text(encoding="utf-8"), SIDE)
    except ValueError as error:
        raise DependencyError(f"{frozen} cannot be read as an SSD ({error})") from error


class Ssd:
    """The network; loaded on first use. Threads may share it.

    Args:
        device: ``"cpu"`` or ``"cuda"``.
    """

    def __init__(self, device: str = "cpu") -> None:
        self.device = device

    @cached_property
    def _network(self) -> Network:
        graph = ssd_graph()
        # One thread a window: several windows on as many cores are quicker than one window on all.
        try:
            session = open_session(graph.network, self.device, threads=1, name=NAME)
        except Exception as error:  # ONNX Runtime's errors share no class of their own
            raise DependencyError(f"the SSD cannot be run ({error})") from error

        def see(small: NDArray[np.uint8], floor: float) -> FloatArray:
            encodings, scores = session.run([ENCODINGS, SCORES], {IMAGES: small[None]})
            return decode(encodings[0], scores[0], graph.priors, graph.variance, floor)

        return see

    def boxes(self, rgb: NDArray[np.uint8], *, floor: float = 0.05, tiles: bool = True) -> RawBoxes:
        """Everything the network sees above ``floor``, on the whole photo and on its four quarters.

        Args:
            rgb: (H, W, 3) uint8.
            floor: Lowest score that is kept.
            tiles: Also look at the quarters; finds smaller objects at five times the cost.

        Returns:
            Boxes with overlaps between photo and tiles left in.

        Raises:
            DependencyError: the weights are missing or damaged.
        """
        height, width = rgb.shape[:2]
        windows = [(0.0, 0.0, 1.0, 1.0)]
        if tiles and min(height, width) >= SIDE:
            windows += QUARTERS
        network = self._network
        found = spread(lambda w: _window(network, rgb, np.array(w), floor), windows)
        rows = np.concatenate(found)
        return RawBoxes(boxes=rows[:, 2:], classes=rows[:, 0].astype(np.int64), scores=rows[:, 1])


def _window(network: Network, rgb: NDArray[np.uint8], window: FloatArray, floor: float) -> FloatArray:
    """(N, 6) class, score, x0, y0, x1, y1 in photo pixels."""
    size = np.array([rgb.shape[1], rgb.shape[0]] * 2, np.float64)
    x0, y0, x1, y1 = np.rint(window * size).astype(int)
    part = rgb[y0:y1, x0:x1]
    # The area filter keeps fine structure of large photos from aliasing at 300 pixels.
    shrinks = part.shape[0] > SIDE and part.shape[1] > SIDE
    small = cv2.resize(part, (SIDE, SIDE), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR)
    rows = network(np.asarray(small, np.uint8), floor)
    box = rows[:, 2:]
    cut = (window[:2] > 0) & (box[:, :2] < CUT)
    cut |= (window[2:] < 1) & (box[:, 2:] > 1 - CUT)
    box = np.clip(box, 0.0, 1.0) * np.array([x1 - x0, y1 - y0] * 2) + np.array([x0, y0] * 2)
    whole = ~cut.any(axis=1) & (box[:, 2:] - box[:, :2] >= 1.0).all(axis=1)
    return np.asarray(np.column_stack([rows[:, 0], np.clip(rows[:, 1], 0, 1), box])[whole])
