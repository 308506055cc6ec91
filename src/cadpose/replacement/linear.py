"""Display values and linear light: what adds up in a picture is light, not sRGB."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

#: Real numbers of either width: pictures are kept in single precision, as large photos are many numbers.
Reals = NDArray[np.floating]

#: Luminance of linear RGB (ITU-R BT.709).
LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)

_STEPS = 65535
_LEVELS = np.arange(256) / 255.0
_LINEAR = np.where(_LEVELS <= 0.04045, _LEVELS / 12.92, ((_LEVELS + 0.055) / 1.055) ** 2.4).astype(np.float32)
_LIGHT = np.arange(_STEPS + 1) / _STEPS
_DISPLAY = 255.0 * np.where(_LIGHT <= 0.0031308, 12.92 * _LIGHT, 1.055 * _LIGHT ** (1 / 2.4) - 0.055)
_DISPLAY = _DISPLAY.astype(np.float32)


def linear(rgb: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(...) uint8 sRGB to linear light in [0, 1] (IEC 61966-2-1)."""
    return np.asarray(_LINEAR[rgb])


def display(light: Reals) -> NDArray[np.float32]:
    """Linear light to sRGB in [0, 255], not rounded; what is brighter than white stays white."""
    # A table: powers of millions of numbers take seconds. Its steps are below a twentieth of a level.
    index = (np.clip(light, 0.0, 1.0) * _STEPS + 0.5).astype(np.uint16)
    return np.asarray(_DISPLAY[index])


def luminance(light: Reals) -> Reals:
    """(..., 3) linear RGB to (...) luminance."""
    return np.asarray(light @ LUMA)
