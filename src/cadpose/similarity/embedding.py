"""The view embedding: a crop of a photo and a render of the same model from there lie close together.

One network sees both. It comes as an ONNX file with the input ``images`` and the output ``embedding``.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.boxes import Box
from cadpose.onnx_session import open_session
from cadpose.photos import FILL, crop_square
from cadpose.records import Views
from cadpose.weights import REGISTRY, ensure

#: Side of the squares that are embedded, in pixels.
SIDE = 112
#: Length of an embedding.
DIMENSIONS = 128
#: Environment variable that names another network than the shipped one.
VARIABLE = "CADPOSE_EMBEDDING"

#: A network of this kind is a few megabytes; what is far larger is something else.
_MOST_BYTES = 512 * 2**20
#: Images a run: activations of more fall out of the CPU's cache, which was measured to take longer.
_BATCH = 1


class ViewEmbedder:
    """Embeds crops and renders. One instance may be used from several threads.

    Args:
        network: The ONNX file, or its bytes.
        device: ``"cpu"`` or ``"cuda"``.
        threads: Threads within one operator; 0 lets ONNX Runtime choose.

    Attributes:
        sha256: Digest of the network: part of the key of everything made with it.

    Raises:
        InputError: it cannot be read, or is no such network.
    """

    def __init__(self, network: Path | bytes, device: str = "cpu", threads: int = 0) -> None:
        name = "the network" if isinstance(network, bytes) else str(network)
        data = network if isinstance(network, bytes) else _read(network)
        self.sha256 = hashlib.sha256(data).hexdigest()
        try:
            self._session = open_session(data, device, threads)
            probe = self.embed(np.full((1, SIDE, SIDE, 3), FILL, np.uint8))
        except Exception as error:  # ONNX Runtime's errors share no class of their own
            reason = (str(error) or type(error).__name__).splitlines()[0][:160]
            raise InputError(
                f"{name} is no network that embeds views ({reason}): name another file"
            ) from error
        if not abs(float(np.linalg.norm(probe[0])) - 1.0) < 1e-2:
            raise InputError(f"{name} gives embeddings that are not of unit length: name another file")

    def embed(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        """(N, 112, 112, 3) uint8 RGB to (N, 128) float32 of unit length.

        Raises:
            ValueError: the images have another shape or type, or the network answers another shape.
        """
        if images.dtype != np.uint8 or images.shape[1:] != (SIDE, SIDE, 3):
            raise ValueError(f"expected (N, {SIDE}, {SIDE}, 3) uint8, got {images.shape} {images.dtype}")
        out = np.empty((len(images), DIMENSIONS), np.float32)
        for first in range(0, len(images), _BATCH):
            batch = images[first : first + _BATCH]
            got = np.asarray(self._session.run(["embedding"], {"images": batch})[0])
            if got.shape != (len(batch), DIMENSIONS):
                raise ValueError(f"the network answers {got.shape}, not {(len(batch), DIMENSIONS)}")
            out[first : first + _BATCH] = got
        return out

    def crop(self, rgb: NDArray[np.uint8], box: Box) -> NDArray[np.float32]:
        """(128,) embedding of the object in a box of a photo, (H, W, 3) uint8.

        Raises:
            ValueError: the box does not meet the photo.
        """
        return np.asarray(self.embed(crop_square(rgb, box, SIDE)[None])[0])

    def views(self, views: Views) -> NDArray[np.float32]:
        """(N, 128) embeddings of renders of 112 px, framed as crops are."""
        return self.embed(views.over(FILL))


def embedding_network(told: Path | None = None) -> Path:
    """The network's file: the one told, else of ``$CADPOSE_EMBEDDING``, else the shipped one.

    Raises:
        DependencyError: there is none.
    """
    variable = os.environ.get(VARIABLE)
    if told is not None or variable:
        return told or Path(str(variable)).expanduser()
    if "embedding" not in REGISTRY:
        raise DependencyError(
            f"no network that embeds views comes with this version: name its ONNX file with --embedding, or "
            f"with ${VARIABLE}"
        )
    return ensure("embedding")


def _read(path: Path) -> bytes:
    try:
        if path.stat().st_size > _MOST_BYTES:
            raise InputError(f"{path} is far larger than a network that embeds views: name another file")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): name the network's ONNX file") from error
