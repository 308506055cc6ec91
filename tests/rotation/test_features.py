from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.encoder import SIDE, Lite0
from cadpose.rotation.features import (
    LEVELS,
    STEPS,
    Described,
    Level,
    cell_cover,
    cell_statistics,
    describe,
)
from tests.rotation.fakes import random_described


class Deviating(Lite0):
    """Every channel lies ``deviations`` spreads above the library's mean, the last cell not at all."""

    def __init__(self, deviations: float) -> None:
        super().__init__()
        self.deviations = deviations

    def stride16(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        return self._maps(len(images), 0)

    def stride32(self, stride16: NDArray[np.float32]) -> NDArray[np.float32]:
        return self._maps(len(stride16), 1)

    def _maps(self, n: int, which: int) -> NDArray[np.float32]:
        level = LEVELS[which]
        mean, spread = cell_statistics()[level.name]
        out = np.tile((mean + self.deviations * spread)[:, None, None], (n, 1, level.side, level.side))
        out[:, :, -1, -1] = mean
        return out


@pytest.mark.parametrize(
    ("deviations", "stored"), [(0.0, 0), (1.0, 20), (-2.5, -50), (0.03, 1), (100.0, 127), (-100.0, -127)]
)
def test_cells_are_deviations_in_int8_steps(deviations: float, stored: int) -> None:
    assert STEPS == 20.0
    described = describe(Deviating(deviations), np.zeros((2, SIDE, SIDE, 3), np.uint8))
    assert len(described) == 2
    for level, cells, cover in zip(LEVELS, described.cells, described.cover, strict=True):
        assert cells.shape == (2, level.cells, level.channels)
        assert (cells[:, :-1] == stored).all()
        # Rows first: the map's last cell is the list's last.
        assert (cells[:, -1] == 0).all()
        assert (cover == 1.0).all()


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.name)
def test_cover_is_the_share_of_each_cell(level: Level) -> None:
    k = level.stride
    alpha = np.zeros((2, SIDE, SIDE), np.uint8)
    alpha[0, :k, k : 2 * k] = 255  # first row, second column: full
    alpha[0, k : 2 * k, : k // 2] = 255  # second row, first column: half
    alpha[1, -1, -1] = 51  # one pixel, a fifth covered
    cover = cell_cover(alpha, level).reshape(2, level.side, level.side)
    expected = np.zeros_like(cover)
    expected[0, 0, 1], expected[0, 1, 0], expected[1, -1, -1] = 1.0, 0.5, 0.2 / k**2
    np.testing.assert_allclose(cover, expected, atol=1e-7)
    assert cover.dtype == np.float32


def test_statistics_belong_to_the_encoder() -> None:
    for level in LEVELS:
        mean, spread = cell_statistics()[level.name]
        assert mean.shape == spread.shape == (level.channels,)
        assert np.isfinite(mean).all()
        assert (spread > 0).all()


def test_joined_keeps_the_order() -> None:
    a, b = random_described(2, 0), random_described(1, 1)
    both = Described.joined([a, b])
    assert len(both) == 3
    for i in range(len(LEVELS)):
        np.testing.assert_array_equal(both.cells[i][:2], a.cells[i])
        np.testing.assert_array_equal(both.cells[i][2:], b.cells[i])
        np.testing.assert_array_equal(both.cover[i][2:], b.cover[i])


def test_arrays_of_other_shape_or_type_are_refused() -> None:
    good = random_described(2, 0)
    with pytest.raises(ValueError, match="stride16: cells"):
        Described((good.cells[0].astype(np.int16), good.cells[1]), good.cover)
    with pytest.raises(ValueError, match="stride32: cells"):
        Described((good.cells[0], good.cells[1][:1]), good.cover)
    with pytest.raises(ValueError, match="stride32: cover"):
        Described(good.cells, (good.cover[0], good.cover[1][:, :-1]))
