"""The embedded rotation network through ONNX Runtime: a crop and its category to distributions of the angles.

Two members answer, and their probabilities are averaged: PoseContrast's heads on an EfficientNet-Lite that
was fine-tuned on synthetic photos, and a head on the maps of the shared encoder, which was not.
docs/model-card.md tells on what they were trained (``cadpose train rotation``), and how well they do.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.geometry.frames import FloatArray
from cadpose.onnx_session import open_session
from cadpose.rotation.bins import BIN_DEGREES, BINS, decode_hypotheses, probabilities
from cadpose.rotation.features import Described
from cadpose.threads import spread, threads

#: Name of the shipped network.
SHIPPED = "rotation.onnx"
_ANGLES = ("azimuth", "elevation", "inplane")


@dataclass(frozen=True, eq=False)
class AngleDistributions:
    """What the network says of one crop.

    Attributes:
        shares: (24,), (12,), (24,) probabilities of the bins of azimuth, elevation, in-plane rotation.
        offsets: Where in each bin the angle lies, in shares of the bin, same shapes.
    """

    shares: tuple[FloatArray, ...]
    offsets: tuple[FloatArray, ...]

    def likeliest(self, count: int) -> tuple[FloatArray, FloatArray]:
        """(count, 3) angles of the likeliest triples of bins, and (count,) their probabilities."""
        logits = [np.log(np.maximum(s, 1e-12))[None] for s in self.shares]
        angles, chances = decode_hypotheses(logits, [o[None] for o in self.offsets], count)
        return angles[0], chances[0]

    def density(self, angles: FloatArray) -> FloatArray:
        """(N, 3) angles in degrees to (N,) log probability, smooth between the middles of bins."""
        azimuth, elevation, inplane = angles.T
        labels = np.stack([-azimuth % 360.0, elevation + 90.0, (inplane + 180.0) % 360.0], axis=1)
        total = np.zeros(len(angles))
        for i, share in enumerate(self.shares):
            n = BINS[i]
            place = labels[:, i] / BIN_DEGREES - 0.5
            low = np.floor(place).astype(int)
            part = place - low
            if i == 1:
                a, b = np.clip(low, 0, n - 1), np.clip(low + 1, 0, n - 1)
            else:
                a, b = low % n, (low + 1) % n
            total += np.log((1 - part) * share[a] + part * share[b] + 1e-6)
        return total


class RotationNetwork:
    """Runs the network.

    Args:
        path: ONNX file; None for the shipped one.
        device: ``"cpu"`` or ``"cuda"``.
        threads: ONNX Runtime threads; 0 lets it choose.
    """

    def __init__(self, path: Path | None = None, device: str = "cpu", threads: int = 0) -> None:
        self.path = path or Path(str(files("cadpose") / "data" / "weights" / SHIPPED))
        self.device = device
        self.threads = threads

    @cached_property
    def _alone(self) -> Any:
        """The same with one thread an operation: what several crops at once are quickest with."""
        if self.threads == 1 or self.device != "cpu" or threads() == 1:
            return self._session
        return RotationNetwork(self.path, self.device, threads=1)._session

    @cached_property
    def _session(self) -> Any:
        if not self.path.is_file():
            raise DependencyError(f"there is no rotation network at {self.path}: reinstall cadpose.")
        try:
            session = open_session(self.path, self.device, self.threads)
            known = "categories" in session.get_modelmeta().custom_metadata_map
        except Exception as error:  # ONNX Runtime's errors share no class of their own
            raise DependencyError(f"{self.path} cannot be run as a rotation network ({error})") from error
        if not known:
            raise DependencyError(f"{self.path} is no rotation network of cadpose: it names no categories")
        return session

    @cached_property
    def categories(self) -> tuple[str, ...]:
        """The categories that the network was told of in training."""
        return tuple(json.loads(self._session.get_modelmeta().custom_metadata_map["categories"]))

    def look(
        self, crops: NDArray[np.uint8], described: Described, category: str, mirrored: Sequence[bool]
    ) -> AngleDistributions:
        """What all members say of crops of one object, averaged.

        Args:
            crops: (N, 224, 224, 3) uint8; the longer side of the object's box fills the square, white
                beside it.
            described: The same crops as the shared encoder sees them.
            category: Library category; one that the network does not know counts as unknown.
            mirrored: Which of the crops are mirror images.
        """
        told = np.zeros((len(crops), len(self.categories)), np.float32)
        if category in self.categories:
            told[:, self.categories.index(category)] = 1.0
        names = [*_ANGLES, *(f"{a}_offset" for a in _ANGLES)]
        fine, coarse = described.cells
        given: dict[str, NDArray[Any]] = {"images": crops, "fine": fine, "coarse": coarse, "category": told}
        session = self._session if len(crops) == 1 else self._alone

        def one(n: int) -> list[NDArray[np.float32]]:
            crop = {name: values[n : n + 1] for name, values in given.items()}
            answer: list[NDArray[np.float32]] = session.run(names, crop)
            return answer

        each = range(len(crops))
        told_of_each = [one(n) for n in each] if self.threads == 1 else spread(one, each)
        out = [np.concatenate(some) for some in zip(*told_of_each, strict=True)]
        shares, offsets = [], []
        for i in range(3):
            share, offset = probabilities(out[i]), out[3 + i].astype(np.float64)
            for n in np.flatnonzero(mirrored):
                if i != 1:
                    # Label l of the mirror image is label -l: bins and offsets run the other way.
                    share[n], offset[n] = share[n, :, ::-1], 1.0 - offset[n, :, ::-1]
            bins = share.shape[-1]
            share, offset = share.reshape(-1, bins), offset.reshape(-1, bins)
            mean = share.mean(axis=0)
            shares.append(mean)
            offsets.append((share * offset).sum(axis=0) / np.maximum(len(share) * mean, 1e-12))
        return AngleDistributions(tuple(shares), tuple(offsets))
