"""Display values and linear light: what adds up in a picture is light, not sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray

#: Luminance of linear RGB (ITU-R BT.709).
LUMA = np.array([0.2126, 0.7152, 0.0722])

_LEVELS = np.arange(256) / 255.0
_LINEAR = np.where(_LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4)


def linear(rgb: NDArray[np.uint8]) -> FloatArray:
    """(...) uint8 sRGB to linear light in [0, 1] (IEC 61966-2-1)."""
    return np.asarray(_LINEAR[rgb])


def display(light: FloatArray) -> FloatArray:
    """Linear light to sRGB in [0, 255], not rounded; what is brighter than white stays white."""
    c = np.clip(light, 0.0, 1.0)
    return np.asarray(255.0 * np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055))


def luminance(light: FloatArray) -> FloatArray:
    """(..., 3) linear RGB to (...) luminance."""
    return np.asarray(light @ LUMA)
