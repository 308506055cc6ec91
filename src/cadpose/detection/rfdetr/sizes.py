"""The published sizes of RF-DETR-Seg, and how each one's outputs are read.

The numbers are those of ``RFDETRSeg*Config`` in Roboflow's package ``rfdetr`` 1.11.2. Its networks give 91
logits whose position is COCO's id, and masks at a quarter of the input's resolution.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

from cadpose.detection.onnx_head import Boxes, Head, HeadInput, QueryMasks, Scores, Suppression

#: Side of the square patches that the backbone sees, in pixels.
PATCH = 12
#: Groups of queries in training; the first is used.
GROUPS = 13
#: Names of the network's outputs, as Roboflow's own export has them.
BOXES, LOGITS, MASKS = "dets", "labels", "masks"


@dataclass(frozen=True, slots=True)
class Size:
    """One published network.

    Attributes:
        name: ``"n"`` to ``"2xl"``.
        side: Side of its square input in pixels.
        windows: Windows a side in which the backbone attends.
        layers: Layers of the decoder, and blocks of the mask head.
        queries: Most objects a photo.

    Raises:
        ValueError: the patches do not fill the windows.
    """

    name: str
    side: int
    windows: int
    layers: int
    queries: int

    def __post_init__(self) -> None:
        if self.side % (PATCH * self.windows):
            raise ValueError(f"a side of {self.side} is no multiple of {PATCH * self.windows}")

    @property
    def weights(self) -> str:
        """Their name in :mod:`cadpose.weights`."""
        return f"rf-detr-seg-{self.name}"


SIZES: MappingProxyType[str, Size] = MappingProxyType(
    {
        s.name: s
        for s in (
            Size("n", 312, 1, 4, 100),
            Size("s", 384, 2, 4, 100),
            Size("m", 432, 2, 5, 200),
            # The file holds 300 queries a group, going by its length; the package uses 200 of them.
            Size("l", 504, 2, 5, 200),
            Size("xl", 624, 2, 6, 300),
            Size("2xl", 768, 2, 6, 300),
        )
    }
)


def head_of(side: int, network: str, sha256: str | None = None) -> Head:
    """The description of an RF-DETR-Seg network with COCO's classes.

    Photos are stretched without antialiasing and normalised by ImageNet's statistics, as ``predict`` of
    the package does. It drops no repeats; here boxes of one place in several categories become one.

    Args:
        side: Side of its input in pixels.
        network: Name of its ONNX file.
        sha256: Digest of that file.
    """
    return Head(
        format="cadpose-detector",
        version=1,
        network=network,
        sha256=sha256,
        input=HeadInput(
            name="input",
            size=(side, side),
            resize="stretch",
            mean=(0.485, 0.456, 0.406),
            std=(0.229, 0.224, 0.225),
        ),
        boxes=Boxes(output=BOXES, form="cxcywh", unit="normalised"),
        scores=Scores(output=LOGITS, form="sigmoid"),
        classes="coco-91",
        masks=QueryMasks(kind="queries", output=MASKS),
        suppression=Suppression(iou=0.7),
    )
