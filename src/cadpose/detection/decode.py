"""Raw outputs of a detection network to boxes, scores and masks, as its description tells them.

What cannot be what the description says is refused in a sentence, so that a wrong description does not
end in boxes at wrong places.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.detection.canvas import Canvas
from cadpose.detection.instances import Instances, MaskOf, detections
from cadpose.detection.onnx_head import Boxes, Head, Part, PrototypeMasks, QueryMasks, Scores
from cadpose.geometry.frames import FloatArray
from cadpose.records import Detection

#: Shares of the input beyond which boxes are no shares; objects cut by the edge reach a little outside.
FAR = 10.0
#: Masks are cut off here, so that infinite logits can be interpolated.
STEEP = 1e4

Outputs = Mapping[str, NDArray[Any]]


class OutputError(ValueError):
    """Outputs that are not what the description says; the message goes on after "the network"."""


@dataclass(frozen=True, slots=True)
class _Reader:
    """Checked access to outputs."""

    outputs: Outputs

    def columns(self, part: Part) -> NDArray[np.float32]:
        """(N, C) of a part."""
        array = self.array(part.output, 2)
        table = array.T if part.transposed else array
        stop = table.shape[1] if part.count is None else part.first + part.count
        if not part.first < stop <= table.shape[1]:
            raise OutputError(
                f"gives {table.shape[1]} columns in {part.output}, but the description asks for columns "
                f"{part.first} to {max(stop - 1, part.first)}"
            )
        return table[:, part.first : stop]

    def column(self, part: Part) -> NDArray[np.float32]:
        """(N,) of a part of one column, which may lack its axis."""
        array = self.outputs[part.output]
        if array.ndim == 1 or (array.ndim == 2 and array.shape[0] == 1 and not part.transposed):
            return np.asarray(array.reshape(-1), np.float32)
        table = self.columns(part)
        if table.shape[1] != 1:
            raise OutputError(f"gives {table.shape[1]} columns in {part.output} where one is described")
        return table[:, 0]

    def array(self, name: str, axes: int) -> NDArray[np.float32]:
        """An output without its axis of the batch."""
        array = self.outputs[name]
        if array.ndim == axes + 1 and array.shape[0] == 1:
            array = array[0]
        if array.ndim != axes or array.dtype.kind not in "fiu":
            raise OutputError(
                f"gives {array.dtype} of shape {tuple(array.shape)} in {name}, not numbers with {axes} axes "
                "after a batch of one"
            )
        return np.asarray(array, np.float32)


def instances(head: Head, outputs: Outputs, canvas: Canvas, min_score: float) -> Instances:
    """Every query that a class scores at least ``min_score`` for.

    Args:
        head: The description.
        outputs: The network's outputs by name.
        canvas: Where the photo lies in the input.
        min_score: Lowest score, in [0, 1].

    Raises:
        OutputError: the outputs are not as described, or are not numbers.
    """
    reader = _Reader(outputs)
    scores = _scores(reader, head.scores, len(head.class_names))
    if np.isnan(scores).any():
        raise OutputError("gives scores that are no numbers")
    if scores.size and (scores.min() < -1e-3 or scores.max() > 1.001):
        raise OutputError("gives scores outside 0 to 1: scores.form should be sigmoid or softmax")
    boxes = reader.columns(head.boxes)
    if boxes.shape != (len(scores), 4):
        raise OutputError(f"gives {len(boxes)} x {boxes.shape[1]} boxes for {len(scores)} scores, not 4 each")
    queries = np.flatnonzero(scores.max(axis=1, initial=0.0) >= max(min_score, 1e-6))
    corners = _corners(boxes[queries].astype(np.float64), head.boxes, canvas)
    crop = head.masks is not None and head.masks.crop
    return Instances(
        boxes=corners,
        scores=np.clip(scores[queries].astype(np.float64), 0.0, 1.0),
        mask_of=_masks(reader, head.masks, queries, len(scores)),
        crop=crop,
    )


def head_detections(
    head: Head,
    outputs: Outputs,
    canvas: Canvas,
    classes: Sequence[str | None],
    wanted: Collection[str] | None,
    min_score: float,
    source: str,
) -> list[Detection]:
    """Detections in photo pixels, best first; see :func:`cadpose.detection.instances.detections`.

    Raises:
        OutputError: the outputs are not as described, or are not numbers.
    """
    return detections(
        instances(head, outputs, canvas, min_score),
        canvas,
        classes,
        wanted,
        min_score=min_score,
        suppression=head.suppression,
        most=head.most,
        source=source,
        vans=isinstance(head.classes, str),
    )


def _scores(reader: _Reader, part: Scores, classes: int) -> NDArray[np.float32]:
    """(N, classes) in [0, 1]."""
    if part.labels is not None:
        return _labelled(reader, part, part.labels, classes)
    scores = _activated(reader.columns(part), part.form)
    if part.no_object is not None:
        scores = scores[:, 1:] if part.no_object == "first" else scores[:, :-1]
    if scores.shape[1] != classes:
        raise OutputError(f"scores {scores.shape[1]} classes, but the description has {classes}")
    return scores * _objectness(reader, part, len(scores))[:, None]


def _labelled(reader: _Reader, part: Scores, labels: Part, classes: int) -> NDArray[np.float32]:
    score = _activated(reader.column(part), part.form)
    label = reader.column(labels)
    if len(label) != len(score):
        raise OutputError(f"gives {len(label)} labels for {len(score)} scores")
    score = score * _objectness(reader, part, len(score))
    # Rows that fill the output up to its length carry labels such as -1, with a score of 0.
    filling = score <= 0.0
    number = np.where(filling | ~np.isfinite(label), 0.0, label)
    if (~np.isfinite(label) & ~filling).any() or (number < 0).any() or (number >= classes).any():
        raise OutputError(f"gives labels outside 0 to {classes - 1}, the classes of the description")
    table = np.zeros((len(score), classes), np.float32)
    table[np.arange(len(score)), np.rint(number).astype(np.intp).clip(0, classes - 1)] = score
    return table


def _objectness(reader: _Reader, part: Scores, count: int) -> NDArray[np.float32]:
    """(N,) what all scores of a query are multiplied by."""
    if part.objectness is None:
        return np.ones(count, np.float32)
    form = "sigmoid" if part.form == "softmax" else part.form
    score = _activated(reader.column(part.objectness), form)
    if len(score) != count:
        raise OutputError(f"gives {len(score)} values of objectness for {count} scores")
    return score


def _activated(values: NDArray[np.float32], form: str) -> NDArray[np.float32]:
    if form == "sigmoid":
        return np.asarray(1.0 / (1.0 + np.exp(-np.clip(values, -80.0, 80.0))), np.float32)
    if form == "softmax":
        clipped = np.clip(values, -STEEP, STEEP)
        raised = np.exp(clipped - clipped.max(axis=1, keepdims=True))
        return np.asarray(raised / raised.sum(axis=1, keepdims=True), np.float32)
    return values


def _corners(boxes: FloatArray, part: Boxes, canvas: Canvas) -> FloatArray:
    """(N, 4) x0, y0, x1, y1 in canvas pixels."""
    if not np.isfinite(boxes).all():
        raise OutputError("gives boxes that are no numbers")
    reach = np.abs(boxes).max(axis=1)
    if part.unit == "normalised":
        # A single wild box is no sign of a wrong description.
        if len(boxes) and np.median(reach) > FAR:
            raise OutputError(
                f"gives boxes up to {reach.max():.0f}, which are no shares: boxes.unit should be pixels"
            )
        boxes = boxes * np.array(canvas.size * 2, np.float64)
    elif len(boxes) and reach.max() <= 1.5:
        raise OutputError("gives boxes within a pixel and a half: boxes.unit should be normalised")
    first, second = boxes[:, :2], boxes[:, 2:]
    if part.form == "cxcywh":
        return np.hstack([first - second / 2.0, first + second / 2.0])
    return np.hstack([first, first + second]) if part.form == "xywh" else boxes


def _masks(
    reader: _Reader, masks: QueryMasks | PrototypeMasks | None, queries: NDArray[np.intp], count: int
) -> MaskOf | None:
    """Gives the map of the i-th of the kept queries, computed when it is asked for."""
    if masks is None:
        return None
    if isinstance(masks, PrototypeMasks):
        weights = reader.columns(masks.coefficients)
        prototypes = reader.array(masks.output, 3)
        if weights.shape != (count, len(prototypes)) or 0 in prototypes.shape:
            raise OutputError(
                f"gives {weights.shape[0]} x {weights.shape[1]} coefficients for {count} boxes and "
                f"{len(prototypes)} prototypes"
            )
        return lambda i: _numbers(np.tensordot(weights[queries[i]], prototypes, axes=1))
    maps = reader.array(masks.output, 3)
    if len(maps) != count or 0 in maps.shape[1:]:
        raise OutputError(f"gives masks of shape {maps.shape} for {count} boxes")
    border = 0.5 if masks.form == "probability" else 0.0
    return lambda i: _numbers(maps[queries[i]] - border)


def _numbers(values: NDArray[np.float32]) -> NDArray[np.float32]:
    if np.isnan(values).any():
        raise OutputError("gives masks that are no numbers")
    return np.clip(values, -STEEP, STEEP)
