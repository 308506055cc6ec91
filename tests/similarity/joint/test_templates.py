from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.similarity.joint.templates import TemplateViews, template_cosines
from tests.similarity.joint.made import random_views


def in_fractions(crop: NDArray[np.int8], views: list[TemplateViews], near: NDArray[np.int64]) -> FloatArray:
    """The same, written down plainly."""
    cells = np.stack([v.cells[near] for v in views]).astype(float)
    mean = (cells.sum(axis=(0, 1)) + 3 * cells.mean(axis=(0, 1, 2))) / (len(views) * len(near) + 3)
    query, seen = crop - mean, cells - mean
    query /= np.linalg.norm(query, axis=1, keepdims=True)
    seen /= np.linalg.norm(seen, axis=-1, keepdims=True)
    padded = np.zeros((16, 16, 112))
    padded[1:-1, 1:-1] = query.reshape(14, 14, 112)
    around = np.stack(
        [padded[y : y + 14, x : x + 14].reshape(196, 112) for y in range(3) for x in range(3)], axis=1
    )
    best = np.einsum("mkcd,cjd->mkcj", seen, around).max(axis=-1)
    cover = np.stack([v.cover[near] for v in views])
    return np.asarray((best * cover).sum(axis=2) / cover.sum(axis=2))


def test_whole_numbers_give_what_fractions_give() -> None:
    rng = np.random.default_rng(3)
    views = [random_views(rng, 6) for _ in range(3)]
    near = np.array([0, 2, 5])
    crop = views[1].cells[2]
    told = template_cosines(crop, views, near)
    assert told.shape == (3, 3)
    np.testing.assert_allclose(told, in_fractions(crop, views, near), atol=2e-3)
    assert told.argmax() == 4 and told.max() > 0.95


def test_the_largest_values_do_not_overflow() -> None:
    rng = np.random.default_rng(4)
    views = [random_views(rng, 2) for _ in range(2)]
    cells = np.where(rng.random((2, 196, 112)) < 0.5, -127, 127).astype(np.int8)
    views[0] = replace(views[0], cells=cells)
    near = np.array([0, 1])
    told = template_cosines(cells[1], views, near)
    np.testing.assert_allclose(told, in_fractions(cells[1], views, near), atol=2e-3)


def test_a_cell_may_lie_one_place_off() -> None:
    rng = np.random.default_rng(5)
    views = [random_views(rng, 1) for _ in range(4)]
    shown = views[2].cells[0].reshape(14, 14, 112)
    for shift, least, most in ((0, 0.9, 1.0), (1, 0.8, 1.0), (2, -1.0, 0.5)):
        crop = np.roll(shown, shift, axis=1).reshape(196, 112)
        found = template_cosines(crop, views, np.array([0]))[:, 0]
        assert least < found[2] <= most + 1e-4
        assert (shift == 2) or found.argmax() == 2


def test_a_view_that_shows_nothing_is_the_worst() -> None:
    rng = np.random.default_rng(6)
    views = [random_views(rng, 2) for _ in range(2)]
    views[1].cover[1] = 0.0
    assert template_cosines(views[0].cells[0], views, np.array([0, 1]))[1, 1] == -1.0


def test_views_that_do_not_fit_together() -> None:
    good = random_views(np.random.default_rng(1), 2)
    assert good.nbytes > 2 * 196 * 112
    with pytest.raises(ValueError, match="cells"):
        replace(good, cells=good.cells[:, :10])
    with pytest.raises(ValueError, match="cover"):
        replace(good, cover=good.cover.astype(np.float64))
    with pytest.raises(ValueError, match="aspect"):
        replace(good, aspect=np.array([1.0, 0.0]))
