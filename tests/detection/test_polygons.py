from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.detection import polygons
from cadpose.detection.polygons import mask_from_polygons

CORNERS = st.lists(st.tuples(st.floats(-10, 60), st.floats(-10, 50)), min_size=3, max_size=8)


@given(CORNERS)
def test_a_pixel_counts_where_its_centre_is_inside(corners: list[tuple[float, float]]) -> None:
    """Against crossing numbers, counted for each pixel by itself."""
    mask = mask_from_polygons(40, 50, [[v for corner in corners for v in corner]])
    rng = np.random.default_rng(len(corners))
    for row, column in rng.integers((0, 0), (40, 50), (25, 2)):
        x, y = column + 0.5, row + 0.5
        crossings = 0
        for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1], strict=True):
            if (ay > y) != (by > y):
                at = ax + (y - ay) * (bx - ax) / (by - ay)
                if abs(at - x) < 1e-9:
                    break  # the centre lies on the edge: either is right
                crossings += at < x
        else:
            assert mask[row, column] == bool(crossings % 2)


def test_rectangles_union_and_overhang() -> None:
    mask = mask_from_polygons(10, 12, [[2, 3, 5, 3, 5, 7, 2, 7], [8, -5, 99, -5, 99, 2, 8, 2]])
    truth = np.zeros((10, 12), np.bool_)
    truth[3:7, 2:5] = True
    truth[0:2, 8:] = True
    np.testing.assert_array_equal(mask, truth)


@pytest.mark.parametrize("polygon", [[], [1, 2, 3], [1, 2, 3, 4], [1, 2, 3, 4, 5, 6, 7]])
def test_no_polygon(polygon: list[float]) -> None:
    with pytest.raises(ValueError, match="three corners"):
        mask_from_polygons(10, 10, [polygon])


def test_too_many_corners(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(polygons, "MAX_CORNERS", 3)
    with pytest.raises(ValueError, match="corners"):
        mask_from_polygons(10, 10, [[0, 0, 1, 0, 1, 1, 0, 1]])
