from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.similarity.index.vectors import VectorIndex


@pytest.fixture(scope="module")
def embeddings() -> NDArray[np.float16]:
    rng = np.random.default_rng(0)
    middle = rng.normal(size=(40, 1, 128))
    drawn = np.repeat(middle, 15, axis=0) + 0.4 * rng.normal(size=(600, 6, 128))
    return np.asarray(drawn / np.linalg.norm(drawn, axis=-1, keepdims=True), np.float16)


@pytest.fixture(scope="module")
def index(embeddings: NDArray[np.float16]) -> VectorIndex:
    categories = [("chair", "table", "lamp")[i % 3] for i in range(600)]
    return VectorIndex([embeddings[:250], embeddings[:0], embeddings[250:]], categories)


def query(embeddings: NDArray[np.float16], row: int, view: int) -> NDArray[np.float32]:
    near = embeddings[row, view].astype(np.float32) + 0.02 * np.random.default_rng(row).normal(size=128)
    return np.asarray(near / np.linalg.norm(near), np.float32)


@pytest.mark.parametrize("category", [None, "table"])
def test_nearly_all_of_the_nearest_are_found(
    index: VectorIndex, embeddings: NDArray[np.float16], category: str | None
) -> None:
    views, shares = np.array([1, 2, 5]), []
    for row in range(1, 600, 30):
        asked = query(embeddings, row, 2)
        found, cosines = index.search(asked, views, category, 50)
        exact, true = index.exact(asked, views, category, 50)
        shares.append(len(np.intersect1d(found, exact)) / 50)
        assert found[0] == exact[0] == row
        np.testing.assert_allclose(cosines[0], true[0])
        assert (np.diff(cosines.max(axis=1)) <= 0).all() and len(set(found)) == 50
    assert np.mean(shares) >= 0.98


def test_exact_search_is_what_it_says(index: VectorIndex, embeddings: NDArray[np.float16]) -> None:
    asked, views = query(embeddings, 7, 0), np.array([0, 3])
    best = (embeddings[:, views].astype(np.float32) @ asked).max(axis=1)
    np.testing.assert_array_equal(index.exact(asked, views, None, 20)[0], np.argsort(-best)[:20])


def test_the_filters_filter(index: VectorIndex, embeddings: NDArray[np.float16]) -> None:
    asked = query(embeddings, 4, 2)  # a table
    found, _ = index.search(asked, np.arange(6), "lamp", 50)
    assert set(found % 3) == {2}
    found, cosines = index.search(asked, np.array([0]), "table", 600)
    assert len(found) == 200 and cosines.shape == (200, 1)
    assert cosines[list(found).index(4), 0] < 0.9  # its view 2 would have been nearer
    for search in (index.search, index.exact):
        assert len(search(asked, np.arange(6), "sofa", 50)[0]) == 0


def test_an_empty_index_finds_nothing() -> None:
    empty = VectorIndex([], [])
    assert len(empty) == 0
    assert len(empty.search(np.zeros(128, np.float32), np.arange(3), None, 5)[0]) == 0
