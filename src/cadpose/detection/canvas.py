"""A photo inside a network's input: where it lies there, and the numbers that the network sees."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.detection.onnx_head import HeadInput
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask


@dataclass(frozen=True, slots=True)
class Canvas:
    """The photo fills ``inner`` of a canvas; positions are continuous pixels, x first.

    Attributes:
        photo: Width and height of the photo.
        size: Width and height of the canvas.
        inner: x0, y0, x1, y1 of the photo in the canvas, whole pixels.

    Raises:
        ValueError: a side has no pixel, or ``inner`` reaches outside.
    """

    photo: tuple[int, int]
    size: tuple[int, int]
    inner: tuple[int, int, int, int]

    def __post_init__(self) -> None:
        x0, y0, x1, y1 = self.inner
        if not (0 <= x0 < x1 <= self.size[0] and 0 <= y0 < y1 <= self.size[1]) or min(self.photo) < 1:
            raise ValueError(f"{self} has no place for its photo")

    @classmethod
    def of(cls, width: int, height: int, wanted: HeadInput) -> Canvas:
        """Where a photo of that size lies in the input that is wanted.

        With ``longest`` the longer side becomes that; stretching rounds each side to the nearest
        multiple, a letterbox pads it to the next.
        """
        if wanted.resize == "stretch":
            size = wanted.size or _nearest(width, height, wanted.longest or 1, wanted.multiple)
            return cls((width, height), size, (0, 0, *size))
        most = wanted.size or (wanted.longest or 1, wanted.longest or 1)
        ratio = min(most[0] / width, most[1] / height)
        inner = (min(max(round(width * ratio), 1), most[0]), min(max(round(height * ratio), 1), most[1]))
        step = wanted.multiple
        size = wanted.size or (-(-inner[0] // step) * step, -(-inner[1] // step) * step)
        x, y = ((size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2) if wanted.place == "centre" else (0, 0)
        return cls((width, height), size, (x, y, x + inner[0], y + inner[1]))

    @property
    def scale(self) -> tuple[float, float]:
        """Canvas pixels a photo pixel, across and down."""
        x0, y0, x1, y1 = self.inner
        return (x1 - x0) / self.photo[0], (y1 - y0) / self.photo[1]

    def filled(self, rgb: NDArray[np.uint8], pad: int, *, antialias: bool = False) -> NDArray[np.uint8]:
        """(height, width, 3) uint8: the photo in its place, ``pad`` around it.

        Args:
            rgb: (H, W, 3) uint8 of the photo's size.
            pad: Grey level.
            antialias: Average when shrinking; else interpolate between the four nearest pixels.
        """
        x0, y0, x1, y1 = self.inner
        shrinks = x1 - x0 < self.photo[0] and y1 - y0 < self.photo[1]
        how = cv2.INTER_AREA if antialias and shrinks else cv2.INTER_LINEAR
        small = np.asarray(cv2.resize(rgb, (x1 - x0, y1 - y0), interpolation=how), np.uint8)
        if small.shape[:2] == self.size[::-1]:
            return small
        out = np.full((self.size[1], self.size[0], 3), pad, np.uint8)
        out[y0:y1, x0:x1] = small
        return out

    def to_photo(self, boxes: FloatArray) -> FloatArray:
        """(N, 4) x0, y0, x1, y1 in the canvas to photo pixels; they may reach outside the photo."""
        corner = np.array([self.inner[0], self.inner[1]] * 2, np.float64)
        return np.asarray((boxes - corner) / np.array(self.scale * 2))

    def mask(self, inside: NDArray[np.float32]) -> Mask:
        """A map over the whole canvas to the photo.

        Args:
            inside: (h, w) float, above 0 inside the object; its cells share the canvas evenly.

        Returns:
            (H, W) bool of the photo's size: the map, linear between the middles of its cells, is above 0.
        """
        width, height = self.photo
        out = np.zeros((height, width), np.bool_)
        rows, cols = np.flatnonzero((inside > 0).any(axis=1)), np.flatnonzero((inside > 0).any(axis=0))
        if not len(rows):
            return out
        # Between cells at or below 0 nothing is above 0: only pixels near the others are looked at.
        (h, w), (sx, sy) = inside.shape, self.scale
        across = _cells(width, sx, self.inner[0], w / self.size[0])
        down = _cells(height, sy, self.inner[1], h / self.size[1])
        x = np.flatnonzero((across > cols[0] - 1) & (across < cols[-1] + 1))
        y = np.flatnonzero((down > rows[0] - 1) & (down < rows[-1] + 1))
        if len(x) and len(y):
            rough = _between(inside, down[y], axis=0)
            out[y[0] : y[-1] + 1, x[0] : x[-1] + 1] = _between(rough, across[x], axis=1) > 0
        return out


def network_input(rgb: NDArray[np.uint8], canvas: Canvas, wanted: HeadInput) -> NDArray[np.float32]:
    """What the network sees: (1, 3, height, width) float32, or (1, height, width, 3) as ``layout`` says.

    Args:
        rgb: (H, W, 3) uint8.
        canvas: Where it lies.
        wanted: What is done to its pixels.
    """
    pixels = canvas.filled(rgb, wanted.pad, antialias=wanted.antialias)
    if wanted.channels == "bgr":
        pixels = pixels[..., ::-1]
    mean, std = np.array(wanted.mean), np.array(wanted.std)
    x = pixels * (wanted.scale / std).astype(np.float32) - (mean / std).astype(np.float32)
    return np.ascontiguousarray((x if wanted.layout == "nhwc" else x.transpose(2, 0, 1))[None], np.float32)


def _nearest(width: int, height: int, longest: int, multiple: int) -> tuple[int, int]:
    """Both sides, times what makes the longer one ``longest``, as the nearest multiples; at least one."""
    ratio = longest / max(width, height)
    across, down = (max(round(side * ratio / multiple), 1) * multiple for side in (width, height))
    return across, down


def _cells(count: int, scale: float, start: int, cells: float) -> FloatArray:
    """(count,) positions of pixels' middles among the middles of a map's cells, which are whole numbers."""
    return np.asarray(((np.arange(count) + 0.5) * scale + start) * cells - 0.5)


def _between(values: NDArray[np.float32], at: FloatArray, axis: int) -> NDArray[np.float32]:
    """The map at positions along one axis, linear between cells, the border going on outside."""
    last = values.shape[axis] - 1
    at = np.clip(at, 0.0, last)
    low = np.minimum(at.astype(np.intp), max(last - 1, 0))
    share = np.expand_dims((at - low).astype(np.float32), 1 - axis)
    a, b = values.take(low, axis=axis), values.take(np.minimum(low + 1, last), axis=axis)
    return np.asarray(a + (b - a) * share)
