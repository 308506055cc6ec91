"""DELF as local features: seven scales, selection by attention, PCA to 40 numbers.

Source: Noh, Araujo, Sim, Weyand, Han, "Large-Scale Image Retrieval with Attentive Deep Local Features", ICCV
2017, and the settings of the authors' example (delf_config_example.pbtxt). Verified in their code: the image
is normalised, then each scale is resized from it by TensorFlow's old bilinear rule; a feature's place is
32 · (row, column) / scale in whole pixels; descriptors are scaled to unit length before and after the PCA,
which is not whitened; non-maximum suppression at an IoU of 1 keeps all, so that the best scores remain.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask
from cadpose.similarity.delf.network import Network, require_torch
from cadpose.similarity.delf.parameters import CHANNELS, DESCRIPTOR, Parameters
from cadpose.similarity.local_features import Features, resize_squares, unit

FloatImage = NDArray[np.float32]

SCALES = (0.25, 0.3536, 0.5, 0.7071, 1.0, 1.4142, 2.0)
#: Image pixels from one feature to the next at scale 1.
STRIDE = 32
MOST_FEATURES = 1000
LEAST_SCORE = 100.0
#: A crop of 224 px has too few cells: it is enlarged to this side at least.
LEAST_SIDE = 512


class Delf:
    """:class:`cadpose.similarity.local_features.LocalFeatures` of DELF.

    Args:
        parameters: Weights; None takes the authors', which a person has to put in place once.
        side: Every image is brought to this side in pixels first, at least 512.
        device: ``"cpu"`` or ``"cuda"``.
        least_score: Features of less attention are left out.

    Raises:
        DependencyError: torch or the weights are not there, or torch has no such device.
        InputError: the weights are damaged.
        ValueError: ``side`` is too small.
    """

    def __init__(
        self,
        parameters: Parameters | None = None,
        *,
        side: int = LEAST_SIDE,
        device: str = "cpu",
        least_score: float = LEAST_SCORE,
    ) -> None:
        if side < LEAST_SIDE:
            raise ValueError(f"side {side} is less than {LEAST_SIDE}")
        require_torch(device)
        parameters = Parameters.official() if parameters is None else parameters
        self.name = parameters.name
        self.side = side
        self.least_score = least_score
        self.parameters = parameters
        self.network: Callable[[FloatImage], tuple[FloatImage, FloatImage]] = Network(parameters, device)

    def describe(self, images: NDArray[np.uint8], masks: Mask | None = None) -> list[Features]:
        """See :class:`LocalFeatures`; a feature counts as within the mask if its place is."""
        enlarged = resize_squares(images, self.side)
        inside = (
            None if masks is None else resize_squares((masks * np.uint8(255)).astype(np.uint8), self.side)
        )
        return [
            self._describe(image, None if inside is None else inside[i] >= 128)
            for i, image in enumerate(enlarged)
        ]

    def _describe(self, image: NDArray[np.uint8], mask: NDArray[np.bool_] | None) -> Features:
        normalised = (image.astype(np.float32) - 128.0) / 128.0
        xy: list[FloatArray] = [np.empty((0, 2))]
        raw: list[NDArray[np.float32]] = [np.empty((0, CHANNELS), np.float32)]
        scores: list[NDArray[np.float32]] = [np.empty(0, np.float32)]
        for scale in SCALES:
            features, score = self.network(resized(normalised, round(self.side * scale)))
            keep = score >= self.least_score
            places = np.argwhere(keep)[:, ::-1].astype(np.float64) * (STRIDE / scale)
            if mask is not None:
                column, row = places.astype(np.int64).T
                within = mask[row, column]
                keep[keep] = within
                places = places[within]
            # Their whole numbers are pixel centres, ours lie at halves.
            xy.append(places + 0.5)
            raw.append(features[keep])
            scores.append(score[keep])
        best = np.argsort(-np.concatenate(scores), kind="stable")[:MOST_FEATURES]
        places = np.concatenate(xy)[best] * (SIDE / self.side)
        return Features(places, reduced(np.concatenate(raw)[best], self.parameters))


def reduced(raw: NDArray[np.float32], parameters: Parameters) -> NDArray[np.float32]:
    """(P, 1024) features to (P, 40) descriptors: unit length, PCA, unit length."""
    if not len(raw):
        return np.empty((0, DESCRIPTOR), np.float32)
    projected = (unit(raw) - parameters.mean) @ parameters.projection.T
    return unit(np.asarray(projected, np.float32))


def resized(image: NDArray[np.float32], side: int) -> NDArray[np.float32]:
    """(S, S, 3) to (side, side, 3) by TensorFlow's resize_bilinear without aligned corners.

    Pixel i of the result lies at i · S / side of the image: corners, not centres, of pixels agree, and
    nothing is averaged when it shrinks.
    """
    size = len(image)
    at = np.arange(side, dtype=np.float32) * np.float32(np.float32(size) / np.float32(side))
    low = at.astype(np.int64)
    high = np.minimum(low + 1, size - 1)
    share = at - low.astype(np.float32)
    across = image[:, low] + (image[:, high] - image[:, low]) * share[None, :, None]
    return np.asarray(across[low] + (across[high] - across[low]) * share[:, None, None], np.float32)
