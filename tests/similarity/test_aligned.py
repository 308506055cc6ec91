from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cadpose.records import Views
from cadpose.similarity import SimilarityMeasure
from cadpose.similarity.aligned import (
    ASPECT_WEIGHT,
    AlignedCosine,
    ViewMaps,
    compare,
    describe_crop,
    describe_views,
    mask_aspect,
)
from tests.similarity.shapes import figure, five_views, photo_of


@pytest.mark.parametrize("kind", range(5))
@pytest.mark.parametrize("tolerance", [0, 1])
def test_the_true_figure_wins(kind: int, tolerance: int) -> None:
    measure: SimilarityMeasure = AlignedCosine(tolerance=tolerance)
    scores = measure.score(photo_of(kind), None, five_views())
    assert scores.shape == (5,)
    assert int(scores.argmax()) == kind
    assert scores.max() <= 1.0


def test_view_size_hardly_matters() -> None:
    small = AlignedCosine().score(photo_of(1), None, five_views(224))
    large = AlignedCosine().score(photo_of(1, 448), None, five_views(448))
    assert int(small.argmax()) == int(large.argmax()) == 1
    np.testing.assert_allclose(small, large, atol=0.12)


def test_a_bracket_is_scored_in_one_call_and_order_does_not_matter() -> None:
    maps = describe_views(five_views())
    joined = ViewMaps.joined([maps, maps])
    assert len(joined) == 10
    photo = describe_crop(photo_of(3))
    twice = compare(photo, joined)
    np.testing.assert_allclose(twice[:5], twice[5:], atol=1e-6)
    order = np.array([4, 2, 0, 3, 1])
    turned = compare(photo, ViewMaps(maps.maps[order], maps.cover[order], maps.aspect[order]))
    np.testing.assert_allclose(turned, compare(photo, maps)[order], atol=1e-5)


def test_aspect_term_is_the_weighted_log_ratio() -> None:
    maps, photo = describe_views(five_views()), describe_crop(photo_of(0))
    aspect = 1.3
    expected = compare(photo, maps) - ASPECT_WEIGHT * np.abs(np.log(aspect / maps.aspect))
    np.testing.assert_allclose(compare(photo, maps, aspect=aspect), expected)


def test_mask_gives_the_aspect_where_none_is_told() -> None:
    mask = figure(0)[1] > 0
    by_mask = AlignedCosine().score(photo_of(0), mask, five_views())
    by_number = AlignedCosine().score(photo_of(0), None, five_views(), aspect=mask_aspect(mask))
    np.testing.assert_array_equal(by_mask, by_number)


def test_tolerance_never_lowers_the_cosine() -> None:
    maps, photo = describe_views(five_views()), describe_crop(np.roll(photo_of(2), 12, axis=1))
    assert (compare(photo, maps, tolerance=1) >= compare(photo, maps) - 1e-6).all()


def test_one_render_alone_still_has_a_meaningful_score() -> None:
    maps = describe_views(five_views())
    alone = [ViewMaps(maps.maps[[k]], maps.cover[[k]], maps.aspect[[k]]) for k in range(5)]
    true, noise = (
        describe_crop(photo_of(2)),
        np.random.default_rng(0).integers(0, 256, (224, 224, 3), np.uint8),
    )
    assert compare(true, alone[2])[0] > 0.2
    assert compare(true, alone[2])[0] > compare(describe_crop(noise), alone[2])[0] + 0.1


def test_an_empty_render_is_worst() -> None:
    views = five_views()
    alpha = views.alpha.copy()
    alpha[4] = 0
    scores = AlignedCosine().score(photo_of(4), None, replace(views, alpha=alpha), aspect=1.4)
    assert int(scores.argmin()) == 4
    assert np.isfinite(scores).all()


def test_wrong_input_is_refused() -> None:
    with pytest.raises(ValueError, match="crop"):
        describe_crop(np.zeros((10, 20, 3), np.uint8))
    flat = Views(
        np.zeros((1, 8, 16, 3), np.uint8), np.zeros((1, 8, 16), np.uint8), np.zeros((1, 8, 16), np.float32)
    )
    with pytest.raises(ValueError, match="square"):
        describe_views(flat)
    maps, photo = describe_views(five_views()), describe_crop(photo_of(0))
    with pytest.raises(ValueError, match="aspect"):
        compare(photo, maps, aspect=0.0)
    with pytest.raises(ValueError, match="render"):
        compare(photo, ViewMaps(maps.maps[:0], maps.cover[:0], maps.aspect[:0]))
