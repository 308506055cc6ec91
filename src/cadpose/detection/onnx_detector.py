"""Any detection or instance-segmentation network in an ONNX file that a JSON file describes."""

from __future__ import annotations

import hashlib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.detection.canvas import Canvas, network_input
from cadpose.detection.decode import OutputError, head_detections
from cadpose.detection.instances import class_categories
from cadpose.detection.onnx_head import Head, network_path, read_head, read_network
from cadpose.errors import InputError
from cadpose.onnx_session import open_session
from cadpose.records import Detection, Photo

_TYPES: dict[str, type[np.generic]] = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(uint8)": np.uint8,
}


class OnnxDetector:
    """Finds objects with a network of the user's; :mod:`cadpose.detection.onnx_head` says how it is told.

    Args:
        description: The JSON file; the ONNX file lies beside it.
        categories: Library categories to keep; None keeps all but people, animals and food.
        device: ``"cpu"`` or ``"cuda"``.
        min_score: Lowest score that is returned; None takes the description's, which is 0.3 if it has none.

    Raises:
        InputError: either file cannot be used, or they do not fit together.
    """

    def __init__(
        self,
        description: Path | str,
        categories: Collection[str] | None = None,
        device: str = "cpu",
        min_score: float | None = None,
    ) -> None:
        self.path = Path(description)
        self.head = read_head(self.path)
        self.categories = None if categories is None else frozenset(categories)
        self.min_score = self.head.min_score if min_score is None else min_score
        self._classes = class_categories(self.head.class_names, self.categories)
        network = read_network(self.path, self.head)
        # Two networks, or one described in two ways, are two detectors.
        told = hashlib.sha256(self.head.model_dump_json().encode())
        told.update(network)
        self.name = f"onnx:{self.path.stem}@{told.hexdigest()[:12]}"
        self._network = network_path(self.path, self.head)
        try:
            self._session = open_session(network, device)
        except Exception as error:  # ONNX Runtime's errors share no class
            raise InputError(f"{self._network} cannot be run as an ONNX file ({_first(error)}).") from None
        self._type = _checked(self._session, self.path, self.head)

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections, best first; with masks of the photo's size where the network gives masks.

        Raises:
            InputError: the network does not run on the described input, or gives what was not described.
        """
        head = self.head
        canvas = Canvas.of(photo.width, photo.height, head.input)
        x = network_input(photo.rgb, canvas, head.input)
        fed = np.clip(np.rint(x), 0, 255).astype(np.uint8) if self._type is np.uint8 else x.astype(self._type)
        try:
            values = self._session.run(list(head.outputs), {head.input.name: fed})
        except Exception as error:
            raise InputError(
                f"{self._network} does not run on an input of {canvas.size[0]} x {canvas.size[1]} pixels, as "
                f"{self.path.name} describes it ({_first(error)})."
            ) from None
        try:
            outputs = dict(zip(head.outputs, (np.asarray(v) for v in values), strict=True))
            return head_detections(
                head, outputs, canvas, self._classes, self.categories, self.min_score, "onnx"
            )
        except OutputError as error:
            raise InputError(f"{self._network}, described by {self.path.name}, {error}.") from None


def _checked(session: Any, path: Path, head: Head) -> type[np.generic]:
    """The type of numbers that the network takes, its names and fixed sizes being as described."""
    inputs = {i.name: i for i in session.get_inputs()}
    if set(inputs) != {head.input.name}:
        raise InputError(f"{path}: the network's inputs are {_listed(inputs)}, not {head.input.name} alone.")
    given = [o.name for o in session.get_outputs() if o.type.startswith("tensor(")]
    for name in head.outputs:
        if name not in given:
            raise InputError(f"{path}: the network has no output {name}; it has {_listed(given)}.")
    taken = inputs[head.input.name]
    if taken.type not in _TYPES:
        raise InputError(f"{path}: the network takes {taken.type}; float, float16 or uint8 can be given.")
    if taken.type == "tensor(uint8)" and head.input.scale != 1.0:
        raise InputError(f"{path}: the network takes whole numbers 0 to 255: input.scale should be 1.")
    if head.input.size is not None:
        width, height = head.input.size
        shape = (1, 3, height, width) if head.input.layout == "nchw" else (1, height, width, 3)
        fits = len(taken.shape) == 4 and all(
            not isinstance(told, int) or told == side for told, side in zip(taken.shape, shape, strict=True)
        )
        if not fits:
            raise InputError(
                f"{path}: the network takes the shape {list(taken.shape)}, but the description makes "
                f"{list(shape)}."
            )
    return _TYPES[taken.type]


def _listed(names: Collection[str]) -> str:
    return ", ".join(sorted(names)) or "none"


def _first(error: Exception) -> str:
    """First line of an error, short enough for a sentence."""
    lines = str(error).splitlines() or [type(error).__name__]
    return lines[0][:200].rstrip(".")
