"""What an ONNX file of a detector takes and gives, told by a small JSON file beside it.

The networks of RF-DETR, DETR and YOLO, and plain detection heads, differ in how a photo is brought to their
size, in how boxes, scores and masks are written, and in their classes. The description tells all of it, so
that none of it is guessed; docs/detection.md explains every key. Unknown keys are refused, since a
misspelt one would leave a default in its place.
"""

from __future__ import annotations

import hashlib
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator, model_validator

from cadpose.detection.coco import COCO_80, COCO_NAMES
from cadpose.detection.faults import first_fault
from cadpose.detection.reading import read_capped, read_start
from cadpose.errors import InputError

#: Largest description, and largest network, in bytes.
MAX_DESCRIPTION, MAX_NETWORK = 2**20, 2**30
#: Longest side that a network may ask for, in pixels.
MAX_SIDE = 4096
#: How the place of tensors in another file is written in an ONNX file; those are refused.
_ELSEWHERE = b"\n\x08location\x12"

_Finite = Annotated[float, Field(allow_inf_nan=False)]
_Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0)]
_Share = Annotated[float, Field(ge=0.0, le=1.0)]
_Side = Annotated[int, Field(ge=1, le=MAX_SIDE)]
_Name = Annotated[str, Field(min_length=1, max_length=200)]
_Triple = tuple[_Finite, _Finite, _Finite]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class HeadInput(_Model):
    """How a photo becomes the network's input: ``(x * scale - mean) / std`` of pixels 0 to 255.

    Attributes:
        name: The input's name.
        layout: Order of the axes; the first is the batch of one.
        size: Width and height in pixels, for a network of one size.
        longest: Longer side in pixels, for a network of many sizes.
        multiple: With ``longest``, both sides are multiples of this.
        resize: ``"stretch"`` changes the sides' ratio, ``"letterbox"`` keeps it and pads.
        place: Where the photo lies in a letterbox.
        pad: Grey level around the photo in a letterbox.
        antialias: Average over the pixels that fall together when shrinking, instead of interpolating.
        channels: Order of the colours.
        scale: Multiplies pixels.
        mean: Taken off after that, in the order of ``channels``.
        std: Divides the rest, in the order of ``channels``.
    """

    name: _Name
    layout: Literal["nchw", "nhwc"] = "nchw"
    size: tuple[_Side, _Side] | None = None
    longest: _Side | None = None
    multiple: Annotated[int, Field(ge=1, le=512)] = 1
    resize: Literal["stretch", "letterbox"]
    place: Literal["centre", "corner"] = "centre"
    pad: Annotated[int, Field(ge=0, le=255)] = 114
    antialias: bool = False
    channels: Literal["rgb", "bgr"] = "rgb"
    scale: _Positive = 1.0 / 255.0
    mean: _Triple = (0.0, 0.0, 0.0)
    std: tuple[_Positive, _Positive, _Positive] = (1.0, 1.0, 1.0)

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if (self.size is None) == (self.longest is None):
            raise ValueError("give one of size and longest")
        if self.longest is None and self.multiple != 1:
            raise ValueError("multiple goes with longest, not with size")
        if self.longest is not None and self.multiple > self.longest:
            raise ValueError("multiple is more than longest")
        return self


class Part(_Model):
    """Numbers of each query: some columns of one of the network's outputs.

    Attributes:
        output: The output's name; shape (1, N, C) or (N, C) for N queries.
        transposed: The shape is (1, C, N) or (C, N) instead.
        first: First column.
        count: Number of columns, None for all from ``first`` on.
    """

    output: _Name
    transposed: bool = False
    first: Annotated[int, Field(ge=0, le=100_000)] = 0
    count: Annotated[int, Field(ge=1, le=100_000)] | None = None


class Boxes(Part):
    """Boxes, in four columns.

    Attributes:
        form: Middle and size, two corners, or corner and size.
        unit: Shares of the input's width and height, or its pixels; padding counts as input.
    """

    form: Literal["cxcywh", "xyxy", "xywh"]
    unit: Literal["normalised", "pixels"]


class Scores(Part):
    """Scores of the classes, a column each.

    Attributes:
        form: ``"sigmoid"`` and ``"softmax"``: logits, to which that is still to be applied;
            ``"probability"``: ready.
        no_object: The column that stands for nothing, which is taken away; usual with softmax.
        objectness: One more column, of the same form, that multiplies all others.
        labels: Numbers of classes, one a query; ``scores`` then has the one column that goes with them.
    """

    form: Literal["sigmoid", "softmax", "probability"]
    no_object: Literal["first", "last"] | None = None
    objectness: Part | None = None
    labels: Part | None = None

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if self.labels is not None and (self.no_object or self.form == "softmax"):
            raise ValueError("labels go with one ready or sigmoid score a query, without no_object")
        return self


class QueryMasks(_Model):
    """A mask for each query, over the whole input at any stride.

    Attributes:
        kind: ``"queries"``.
        output: The output's name; shape (1, N, h, w).
        form: ``"logits"`` are inside above 0, ``"probability"`` above 0.5.
        crop: Leave out what lies outside the box.
    """

    kind: Literal["queries"]
    output: _Name
    form: Literal["logits", "probability"] = "logits"
    crop: bool = False


class PrototypeMasks(_Model):
    """A mask for each query as a sum of K prototypes, inside above 0 (YOLACT, Bolya et al. 2019).

    Attributes:
        kind: ``"prototypes"``.
        output: Name of the prototypes' output; shape (1, K, h, w), over the whole input.
        coefficients: K columns.
        crop: Leave out what lies outside the box.
    """

    kind: Literal["prototypes"]
    output: _Name
    coefficients: Part
    crop: bool = True


class Suppression(_Model):
    """Non-maximum suppression.

    Attributes:
        iou: Overlap of boxes above which the one of the lower score goes.
        across_classes: Also between categories; else within one only.
    """

    iou: _Share
    across_classes: bool = True


class Head(_Model):
    """The whole description.

    Attributes:
        format: ``"cadpose-detector"``.
        version: 1.
        network: The ONNX file, relative to the description's folder and inside it.
        sha256: Its digest, checked where it is given.
        input: What it takes.
        boxes: Where the boxes are.
        scores: Where the scores are.
        classes: Names in the order of the scores; ``"coco-80"`` for COCO's 80 classes in the order of
            their ids, ``"coco-91"`` where the position is the id itself.
        masks: Where the masks are, None for a network without.
        min_score: Lowest score that counts, unless the caller asks for another.
        suppression: None for none; networks such as DETR's need none, but give one object two categories.
        most: Largest number of detections a photo.
    """

    format: Literal["cadpose-detector"]
    version: Literal[1]
    network: Annotated[str, Field(min_length=1, max_length=1000)]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-fA-F]{64}$")] | None = None
    input: HeadInput
    boxes: Boxes
    scores: Scores
    classes: Literal["coco-80", "coco-91"] | Annotated[list[_Name], Field(min_length=1, max_length=100_000)]
    masks: Annotated[QueryMasks | PrototypeMasks, Field(discriminator="kind")] | None = None
    min_score: _Share = 0.3
    suppression: Suppression | None = Suppression(iou=0.7)
    most: Annotated[int, Field(ge=1, le=1000)] = 50

    @field_validator("network")
    @classmethod
    def _stays(cls, name: str) -> str:
        for path in (PurePosixPath(name), PureWindowsPath(name)):
            if path.anchor or ".." in path.parts or "\0" in name:
                raise ValueError("name the ONNX file relative to this file and inside its folder")
        return name

    @property
    def class_names(self) -> tuple[str, ...]:
        """A name for each class in the order of the scores, empty for numbers that COCO does not use."""
        if self.classes == "coco-80":
            return COCO_80
        if self.classes == "coco-91":
            return tuple(COCO_NAMES.get(i, "") for i in range(91))
        return tuple(self.classes)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs that are read, each once."""
        parts = [self.boxes, self.scores, self.scores.objectness, self.scores.labels, self.masks]
        if isinstance(self.masks, PrototypeMasks):
            parts.append(self.masks.coefficients)
        return tuple(dict.fromkeys(p.output for p in parts if p is not None))


def read_head(path: Path) -> Head:
    """A description file, checked.

    Raises:
        InputError: it cannot be read, is too large, is not JSON, or does not hold a description.
    """
    data = read_capped(path, MAX_DESCRIPTION, "a detector's description, a JSON file")
    try:
        return Head.model_validate_json(data)
    except ValidationError as error:
        raise InputError(f"{path} does not describe a detector: {first_fault(error)}.") from None


def network_path(path: Path, head: Head) -> Path:
    """Where the network of the description ``path`` lies.

    Raises:
        InputError: a link leads it out of the description's folder.
    """
    network = path.parent / head.network
    if not network.resolve().is_relative_to(path.parent.resolve()):
        raise InputError(
            f"{path}: {head.network} leads out of its folder: put the ONNX file beside {path.name}."
        )
    return network


def read_network(path: Path, head: Head) -> bytes:
    """The ONNX file of the description ``path``, checked as far as the description tells.

    Raises:
        InputError: it is missing, too large, not the one described, or keeps its weights in another file.
    """
    network = network_path(path, head)
    data = read_start(network, MAX_NETWORK + 1, f"the ONNX file that {path.name} tells of")
    if len(data) > MAX_NETWORK:
        raise InputError(f"{network} is larger than the limit of {MAX_NETWORK // 2**20} MB.")
    if head.sha256 and hashlib.sha256(data).hexdigest() != head.sha256.lower():
        raise InputError(
            f"{network} is not the file that {path.name} describes (SHA-256 differs): get it again, or "
            "correct sha256 if you know why."
        )
    if _ELSEWHERE in data:
        raise InputError(f"{network} keeps its weights in another file: export it as one file.")
    return data
