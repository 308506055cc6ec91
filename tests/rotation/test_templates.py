from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.rotation.features import LEVELS, Described
from cadpose.rotation.templates import Templates
from tests.rotation.fakes import random_described


def reference(galleries: Sequence[Described], query: Described) -> NDArray[np.float64]:
    """The same in floats: standardise over the cover, unit cells, cover-weighted cosine, mean of levels."""
    m, n = len(galleries), len(galleries[0])
    total = np.zeros((m, n))
    for i in range(len(LEVELS)):
        cells = np.stack([g.cells[i] for g in galleries]).astype(np.float64)
        w = np.stack([g.cover[i] for g in galleries]).astype(np.float64)
        share = w[..., None] / w.sum()
        mean = (cells * share).sum(axis=(0, 1, 2))
        spread = np.sqrt(((cells - mean) ** 2 * share).sum(axis=(0, 1, 2)))

        def unit(x: NDArray[np.float64], mean: object = mean, spread: object = spread) -> NDArray[np.float64]:
            z = (x - mean) / np.maximum(spread, 1.0)  # type: ignore[operator,call-overload]
            return np.asarray(z / np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-6))

        photo = unit(query.cells[i][0].astype(np.float64))
        cosine = np.einsum("mnpc,pc->mnp", unit(cells), photo)
        total += (cosine * w).sum(axis=-1) / np.maximum(w.sum(axis=-1), 1e-6)
    return total / len(LEVELS)


def with_cells(like: Described, change: Sequence[NDArray[np.int8]]) -> Described:
    return Described(tuple(change), like.cover)


def only(like: Described, index: int) -> Described:
    return Described(
        tuple(c[index : index + 1].copy() for c in like.cells),
        tuple(c[index : index + 1].copy() for c in like.cover),
    )


def test_cosines_equal_a_float_reference() -> None:
    galleries = [random_described(4, seed) for seed in range(3)]
    # Half of each: cosines well away from zero, of both signs.
    mixed = [
        np.clip(0.6 * a[2:3] - 0.5 * b[1:2], -127, 127).astype(np.int8)
        for a, b in zip(galleries[1].cells, galleries[0].cells, strict=True)
    ]
    query = with_cells(random_described(1, 9), mixed)
    got, expected = Templates(galleries).cosines(query), reference(galleries, query)
    assert got.shape == (3, 4)
    np.testing.assert_allclose(got, expected, atol=0.004)
    assert expected[1, 2] > 0.5
    assert expected[0, 1] < -0.5
    assert got.argmax() == 4 * 1 + 2


def test_an_image_is_most_like_itself() -> None:
    galleries = [random_described(3, seed) for seed in (4, 5)]
    got = Templates(galleries).cosines(only(galleries[1], 0))
    assert got[1, 0] == pytest.approx(1.0, abs=0.01)
    assert np.sort(got.ravel())[-2] < 0.2


def test_cells_that_the_template_does_not_cover_count_nothing() -> None:
    gallery, query = random_described(3, 0), random_described(1, 1)
    half = tuple(np.where(np.arange(c.shape[1]) % 2, c, np.float32(0)) for c in gallery.cover)
    changed = [
        np.where(np.arange(c.shape[1])[None, :, None] % 2, c, -c).astype(np.int8) for c in gallery.cells
    ]
    a = Templates([Described(gallery.cells, half)]).cosines(query)
    b = Templates([Described(tuple(changed), half)]).cosines(query)
    np.testing.assert_array_equal(a, b)
    # With cover they do count.
    whole = Templates([Described(tuple(changed), gallery.cover)]).cosines(query)
    assert np.abs(whole - a).max() > 1e-3


def test_a_template_that_covers_nothing_scores_zero() -> None:
    gallery = random_described(2, 0)
    cover = tuple(c.copy() for c in gallery.cover)
    for c in cover:
        c[0] = 0.0
    got = Templates([Described(gallery.cells, cover)]).cosines(only(gallery, 0))
    assert got[0, 0] == 0.0
    assert got[0, 1] != 0.0


def test_a_channel_that_never_changes_does_not_outweigh_the_others() -> None:
    galleries = [random_described(3, seed) for seed in (0, 1)]
    for g in galleries:
        for cells in g.cells:
            cells[..., 5] = 30
    query = only(galleries[0], 1)
    for cells in query.cells:
        cells[..., 5] = 33
    got = Templates(galleries).cosines(query)
    assert np.isfinite(got).all()
    # Three int8 steps in a constant channel are noise, not what the photo is about.
    assert got[0, 1] > 0.9
    np.testing.assert_allclose(got, reference(galleries, query), atol=0.004)


def test_nbytes_counts_every_array() -> None:
    one = Templates([random_described(2, 0)]).nbytes
    cells = sum(2 * level.cells * (level.channels + 4) for level in LEVELS)
    assert one == cells
    assert Templates([random_described(2, 0), random_described(2, 1)]).nbytes == 2 * one


def test_galleries_must_fit_together() -> None:
    with pytest.raises(ValueError, match="at least one gallery"):
        Templates([])
    with pytest.raises(ValueError, match="the same rotations"):
        Templates([random_described(2, 0), random_described(3, 0)])


def test_one_image_at_a_time() -> None:
    with pytest.raises(ValueError, match="one described image, got 2"):
        Templates([random_described(2, 0)]).cosines(random_described(2, 1))


def test_several_images_at_once_are_each_by_itself() -> None:
    templates = Templates([random_described(3, seed) for seed in range(2)])
    queries = random_described(2, 9)
    both = templates.cosines_of_each(queries)
    assert both.shape == (2, 2, 3)
    for q in range(2):
        np.testing.assert_array_equal(both[q], templates.cosines(only(queries, q)))
