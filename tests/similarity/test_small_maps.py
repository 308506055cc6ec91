from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cadpose.encoder import lite0
from cadpose.records import Views
from cadpose.similarity.local_features import BACKGROUND
from cadpose.similarity.small_maps import CHANNELS, SIDE, SmallMaps, compare, describe_crop, describe_views
from tests.similarity.shapes import figure


@pytest.fixture(scope="module")
def views() -> Views:
    drawn = [figure(kind, SIDE) for kind in range(5)]
    rgb, alpha = (np.stack(part) for part in zip(*drawn, strict=True))
    return Views(rgb, alpha, np.where(alpha > 0, 2.0, np.inf).astype(np.float32))


@pytest.fixture(scope="module")
def maps(views: Views) -> SmallMaps:
    return describe_views(views, lite0(threads=1))


def test_every_figure_is_most_like_itself(views: Views, maps: SmallMaps) -> None:
    for kind, crop in enumerate(views.over(BACKGROUND)):
        scores = compare(describe_crop(crop, lite0(threads=1)), maps, float(maps.aspect[kind]))
        assert scores.argmax() == kind
        # Bytes and 24 of 112 channels: nearly the same.
        assert 0.97 < scores[kind] <= 1.0 + 1e-6


def test_a_box_of_another_shape_costs(views: Views, maps: SmallMaps) -> None:
    photo = describe_crop(views.over(BACKGROUND)[0], lite0(threads=1))
    aspect = float(maps.aspect[0])
    assert compare(photo, maps, 2 * aspect)[0] == pytest.approx(
        compare(photo, maps, aspect)[0] - 0.5 * np.log(2)
    )


def test_an_empty_render_is_no_match(views: Views, maps: SmallMaps) -> None:
    cells = maps.cells.copy()
    cells[2, ..., CHANNELS] = 0
    photo = describe_crop(views.over(BACKGROUND)[2], lite0(threads=1))
    assert compare(photo, replace(maps, cells=cells), float(maps.aspect[2]))[2] == -1.0


def test_what_does_not_fit_is_refused(views: Views, maps: SmallMaps) -> None:
    photo = describe_crop(views.over(BACKGROUND)[0], lite0(threads=1))
    with pytest.raises(ValueError, match="aspect"):
        compare(photo, maps, 0.0)
    with pytest.raises(ValueError, match="at least one"):
        compare(photo, SmallMaps(maps.cells[:0], maps.aspect[:0]), 1.0)
    with pytest.raises(ValueError, match="112"):
        describe_crop(np.zeros((96, 96, 3), np.uint8), lite0(threads=1))
    with pytest.raises(ValueError, match="views"):
        SmallMaps(maps.cells, maps.aspect[:2])
