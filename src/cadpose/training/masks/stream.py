"""An endless stream of synthetic objects with their masks, drawn by worker processes in a fixed order."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.utils.data import IterableDataset

from cadpose.training.lite.stream import Source, worker_chunks

#: Photos that a worker draws at once, a whole number of series.
_CHUNK = 2
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


class MaskStream(IterableDataset[MaskedObjects]):
    """Chunks of objects from photo ``first`` on; worker w of W draws chunks w, w + W, ...

    Args:
        source: What is drawn from.
        first: Number of the first photo.
        photos: How many photos, None for no end.
    """

    def __init__(self, source: Source, first: int = 0, photos: int | None = None) -> None:
        self.source, self.first, self.photos = source, first, photos

    @property
    def chunk(self) -> int:
        """Photos a chunk."""
        return _CHUNK * self.source.options.series

    def __iter__(self) -> Iterator[MaskedObjects]:
        generator = self.source.generator()
        for numbers in worker_chunks(self.first, self.photos, self.chunk):
            rows = []
            for photo in map(generator.photo, numbers):
                picture = np.ascontiguousarray(photo.rgb.transpose(2, 0, 1))
                rows += [
                    (picture, o.mask, o.visible_box.to_tuple())
                    for o in photo.objects
                    if max(o.visible_box.width, o.visible_box.height) >= _LEAST_SIDE
                ]
            if rows:
                pictures, masks, boxes = zip(*rows, strict=True)
                yield MaskedObjects(
                    torch.from_numpy(np.stack(pictures)),
                    torch.from_numpy(np.stack(masks)),
                    torch.tensor(boxes, dtype=torch.float32),
                )
