"""What makes a drawn object look taken by the same camera: blur, noise, and a photo's lack of colour."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask
from cadpose.replacement.linear import Reals

# Gaussian sigma that the estimate gives for a sharp, anti-aliased edge.
_SHARP = 0.85
_MOST_BLUR, _MOST_NOISE = 3.0, 8.0
# Levels by which a photo's colour may stray from one colour a brightness and still be a monochrome one.
_TONED = 5.0
_LUMA = np.array([0.299, 0.587, 0.114])


@dataclass(frozen=True, eq=False)
class Look:
    """How a photo looks.

    Attributes:
        blur: Gaussian sigma in pixels to blur a drawing by.
        noise: Standard deviation of its grain in levels of 255.
        tone: (256, 3) the photo's colour of each brightness where it is monochrome, else None.
    """

    blur: float
    noise: float
    tone: FloatArray | None

    def toned(self, rgb: Reals) -> Reals:
        """(..., 3) display values in [0, 255] in the photo's one tone, where it has one."""
        if self.tone is None:
            return rgb
        level = np.clip(rgb @ _LUMA, 0.0, 255.0)
        return np.stack([np.interp(level, np.arange(256), self.tone[:, i]) for i in range(3)], axis=-1)

    def grain(self, shape: tuple[int, int], seed: int) -> NDArray[np.float32]:
        """(H, W) levels to add; the same seed gives the same grain."""
        if self.noise <= 0:
            return np.zeros(shape, np.float32)
        drawn = np.random.default_rng(seed).standard_normal(shape, np.float32)
        # Grain of a photo that was demosaiced and compressed is never finer than a pixel.
        soft = cv2.GaussianBlur(drawn, (0, 0), 0.6)
        return np.asarray(soft * (self.noise / max(float(soft.std()), 1e-6)), np.float32)


def look_of(rgb: NDArray[np.uint8], about: Mask) -> Look:
    """The look of a photo.

    Args:
        rgb: (H, W, 3) uint8.
        about: (H, W) the pixels whose sharpness counts: those near the object, but not of it.
    """
    grey = (rgb @ _LUMA).astype(np.float32)
    return Look(_blur(grey, about), _noise(grey, about), _tone(rgb))


def _blur(grey: NDArray[np.float32], about: Mask) -> float:
    """How wide the sharpest edges are: height of the step over its steepest slope is sqrt(2 pi) sigma."""
    dx = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=1) / 2.0
    dy = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=1) / 2.0
    slope = np.hypot(dx, dy).astype(np.float32)
    kernel = np.ones((9, 9), np.uint8)
    step = cv2.dilate(grey, kernel) - cv2.erode(grey, kernel)
    peak = slope >= cv2.dilate(slope, np.ones((3, 3), np.uint8))
    edges = about & peak & (step > 40.0)
    if edges.sum() < 30:
        return 0.0
    width = step[edges] / (2.5066 * np.maximum(slope[edges], 1e-3))
    sigma = float(np.quantile(width, 0.2))
    return float(np.sqrt(np.clip(sigma**2 - _SHARP**2, 0.0, _MOST_BLUR**2)))


def _noise(grey: NDArray[np.float32], about: Mask) -> float:
    """Immerkaer's operator (1996), where the photo is flattest: elsewhere it measures texture."""
    kernel = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
    detail = np.abs(cv2.filter2D(grey, cv2.CV_32F, kernel))
    # Nothing burnt out: there is no noise left in it.
    counts = about & (grey > 4.0) & (grey < 251.0)
    share = cv2.blur(counts.astype(np.float32), (9, 9))
    local = cv2.blur(np.where(counts, detail, 0.0).astype(np.float32), (9, 9)) / np.maximum(share, 1e-3)
    flat = local[counts & (share > 0.6)]
    if flat.size < 200:
        return 0.0
    # The mean size of a normal variable is sqrt(2 / pi) sigma, and the operator's gain is 6.
    return float(min(np.quantile(flat, 0.1) / 6.0 * np.sqrt(np.pi / 2.0), _MOST_NOISE))


def _tone(rgb: NDArray[np.uint8]) -> FloatArray | None:
    pixels = rgb.reshape(-1, 3)[:: max(1, rgb.size // 300_000)].astype(np.float64)
    level = np.clip(pixels @ _LUMA, 0, 255)
    bins = (level / 8.0).astype(int)
    count = np.bincount(bins, minlength=32)
    mean = (
        np.stack([np.bincount(bins, pixels[:, i], 32) for i in range(3)], axis=1)
        / np.maximum(count, 1)[:, None]
    )
    stray = float(np.sqrt(np.mean((pixels - mean[bins] - (level - mean[bins] @ _LUMA)[:, None]) ** 2)))
    if stray > _TONED:
        return None
    at = np.flatnonzero(count > 0)
    levels = np.arange(256.0)
    centres = mean[at] @ _LUMA
    # Towards black and white the colour goes where no pixel says otherwise.
    offsets = np.concatenate([[np.zeros(3)], mean[at] - centres[:, None], [np.zeros(3)]])
    places = np.concatenate([[-1.0], centres, [256.0]])
    return np.stack(
        [np.clip(levels + np.interp(levels, places, offsets[:, i]), 0, 255) for i in range(3)], axis=1
    )
