"""What cameras, scalers and files do to a picture: blur, noise, low resolution, exposure, JPEG."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.training.synth.kernels import add_noise

Picture = NDArray[np.uint8]


def degraded(picture: Picture, rng: np.random.Generator, chance: float) -> Picture:
    """The picture with exposure and white balance changed, and each other flaw with the given chance."""
    out: NDArray[Any] = picture
    if rng.random() < min(1.0, 2 * chance):
        gain = rng.uniform(0.75, 1.25) * rng.uniform(0.93, 1.07, 3)
        table = np.arange(256)[:, None] * gain + rng.uniform(-12, 12)
        out = cv2.LUT(out, np.clip(table, 0, 255).astype(np.uint8)[None])
    if rng.random() < chance * 0.5:
        side = out.shape[0]
        small = max(16, int(side * rng.uniform(0.2, 0.7)))
        out = cv2.resize(out, (small, small), interpolation=cv2.INTER_AREA)
        how = cv2.INTER_LINEAR if rng.random() < 0.6 else cv2.INTER_CUBIC
        out = cv2.resize(out, (side, side), interpolation=how)
    if rng.random() < chance * 0.6:
        out = cv2.GaussianBlur(out, (0, 0), rng.uniform(0.3, 1.4) * out.shape[0] / 224)
    if rng.random() < chance:
        noise = rng.integers(-128, 128, out.size, np.int8)
        out = np.array(out, np.uint8)
        add_noise(out.reshape(-1), noise, int(rng.integers(4, 20)))
    if rng.random() < chance:
        _, data = cv2.imencode(".jpg", out, [cv2.IMWRITE_JPEG_QUALITY, int(rng.integers(25, 92))])
        out = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    return np.asarray(out, np.uint8)
