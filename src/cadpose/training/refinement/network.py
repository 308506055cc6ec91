"""The refinement network: where each cell of the drawn model went in the photo, and what that means."""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from cadpose.encoder import CHANNELS16, SIDE
from cadpose.rotation.features import LEVELS, STEPS, cell_cover, cell_statistics, standardised

#: Cells along a side of the maps.
CELLS = SIDE // 16
#: How far a cell is looked for, in cells.
REACH = 3
#: What an answer of 1 means: radians, ln f, shares of the crop's side.
UNITS = (0.1, 0.1, 0.1, 0.1, 0.03, 0.03)
#: Largest standardised value.
_MOST = 127.0 / STEPS


class StepNetwork(nn.Module):
    """Two standardised stride-16 maps to a step.

    Args:
        width: Channels of the first layers.
    """

    near: Tensor
    there: Tensor
    place: Tensor

    def __init__(self, width: int = 64) -> None:
        super().__init__()
        self.reduce: nn.Module = _layer(CHANNELS16, width, 1)
        around = (2 * REACH + 1) ** 2
        self.mix: nn.Module = nn.Sequential(
            # Photo, view, their difference, likeness of every view cell to those about it, cover and place.
            _layer(3 * width + around + 3, width, 1),
            _layer(width, width, 3),
            _layer(width, 96, 3, stride=2),
            _layer(96, 96, 3),
            _layer(96, 32, 1),
        )
        self.tell: nn.Module = nn.Sequential(
            nn.Flatten(),
            nn.Linear(32 * (CELLS // 2) ** 2, 256),
            nn.ReLU(),
            nn.Dropout(0.1),
            nn.Linear(256, 7),
        )
        near, there = _neighbours()
        self.register_buffer("near", torch.from_numpy(near)[None], persistent=False)
        self.register_buffer("there", torch.from_numpy(there)[None], persistent=False)
        place = torch.linspace(-1.0, 1.0, CELLS)
        y, x = torch.meshgrid(place, place, indexing="ij")
        self.register_buffer("place", torch.stack([x, y])[None], persistent=False)

    def forward(self, photo: Tensor, view: Tensor, cover: Tensor) -> tuple[Tensor, Tensor]:
        """What to change, and how far off the turn will still be.

        Args:
            photo: (N, 112, 14, 14) standardised map of the crop.
            view: The same of the drawn model.
            cover: (N, 1, 14, 14) share of each cell that the model covers.

        Returns:
            (N, 6) steps in :data:`UNITS` and (N,) angles in units of 0.1 radians.
        """
        n = photo.shape[0]  # not len: the exporter would take it for a constant
        a, b = self.reduce(photo), self.reduce(view)
        unit_photo, unit_view = functional.normalize(photo, dim=1), functional.normalize(view, dim=1)
        likeness = torch.bmm(unit_view.flatten(2).transpose(1, 2), unit_photo.flatten(2))
        likeness = likeness.gather(2, self.near.expand(n, -1, -1)) * self.there
        likeness = likeness.transpose(1, 2).reshape(n, -1, CELLS, CELLS)
        seen = torch.cat([a, b, a - b, likeness, cover, self.place.expand(n, -1, -1, -1)], dim=1)
        told = self.tell(self.mix(seen))
        return told[:, :6], functional.softplus(told[:, 6])


class OfMaps(nn.Module):
    """The network as it is shipped: the encoder's maps as they come, steps and degrees out."""

    mean: Tensor
    spread: Tensor
    units: Tensor

    def __init__(self, network: StepNetwork) -> None:
        super().__init__()
        self.network: nn.Module = network
        mean, spread = cell_statistics()["stride16"]
        self.register_buffer("mean", torch.from_numpy(mean)[None, :, None, None])
        self.register_buffer("spread", torch.from_numpy(spread)[None, :, None, None])
        self.register_buffer("units", torch.tensor(UNITS)[None])

    def forward(self, photo: Tensor, view: Tensor, cover: Tensor) -> tuple[Tensor, Tensor]:
        """(N, 112, 14, 14) maps and (N, 1, 14, 14) cover to (N, 6) steps and (N,) degrees."""
        told: tuple[Tensor, Tensor] = self.network(self._standardised(photo), self._standardised(view), cover)
        step, error = told
        return step * self.units, error * float(np.degrees(UNITS[0]))

    def _standardised(self, maps: Tensor) -> Tensor:
        return ((maps - self.mean) / self.spread).clamp(-_MOST, _MOST)


def cells_of(maps: NDArray[np.float32]) -> NDArray[np.int8]:
    """(N, 112, 14, 14) maps of the encoder to (N, 196, 112) standardised values, times :data:`STEPS`."""
    return standardised(maps, LEVELS[0])


def cover_of(alpha: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(N, 224, 224) coverage to (N, 196), 255 where the model fills the cell."""
    return np.asarray(np.rint(cell_cover(alpha, LEVELS[0]) * 255.0), np.uint8)


def _layer(inside: int, outside: int, kernel: int, stride: int = 1) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(inside, outside, kernel, stride, padding=kernel // 2, bias=False),
        nn.BatchNorm2d(outside),
        nn.ReLU(),
    )


def _neighbours() -> tuple[np.ndarray, np.ndarray]:
    """(196, 49) cells about each cell, and whether they are there: 1 or 0."""
    y, x = np.mgrid[:CELLS, :CELLS]
    steps = [(dy, dx) for dy in range(-REACH, REACH + 1) for dx in range(-REACH, REACH + 1)]
    rows = np.stack([(y + dy).ravel() for dy, _ in steps], axis=1)
    columns = np.stack([(x + dx).ravel() for _, dx in steps], axis=1)
    there = (rows >= 0) & (rows < CELLS) & (columns >= 0) & (columns < CELLS)
    near = rows.clip(0, CELLS - 1) * CELLS + columns.clip(0, CELLS - 1)
    return near.astype(np.int64), there.astype(np.float32)
