"""Synthetic objects with their masks, as they are drawn for training."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from cadpose.training.synth.generator import SynthGenerator

#: Objects whose seen part is smaller, in pixels of the photo, are not learned from.
_LEAST_SIDE = 32.0


@dataclass(frozen=True)
class MaskedObjects:
    """M objects, each with the photo that shows it.

    Attributes:
        photos: (M, 3, S, S) uint8.
        masks: (M, S, S) bool, what is seen of the object.
        boxes: (M, 4) float32 rectangles of what is seen.
    """

    photos: Tensor
    masks: Tensor
    boxes: Tensor

    def __len__(self) -> int:
        return len(self.boxes)

    def fields(self) -> tuple[Tensor, ...]:
        """All tensors, in the order of the attributes."""
        return self.photos, self.masks, self.boxes


def masked_objects(generator: SynthGenerator, numbers: Sequence[int]) -> MaskedObjects | None:
    """The objects of photos with their masks; None where all are too small."""
    rows = []
    for photo in map(generator.photo, numbers):
        picture = np.ascontiguousarray(photo.rgb.transpose(2, 0, 1))
        rows += [
            (picture, o.mask, o.visible_box.to_tuple())
            for o in photo.objects
            if max(o.visible_box.width, o.visible_box.height) >= _LEAST_SIDE
        ]
    if not rows:
        return None
    pictures, masks, boxes = zip(*rows, strict=True)
    return MaskedObjects(
        torch.from_numpy(np.stack(pictures)),
        torch.from_numpy(np.stack(masks)),
        torch.tensor(boxes, dtype=torch.float32),
    )
