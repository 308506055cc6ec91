"""Nearest neighbours among the embeddings of an index: FAISS over bytes, then the best ones exactly.

One flat FAISS index a view: the rotation says which of them are searched. In each the models lie by category,
so a category is a range of numbers. FAISS holds 8 bits a number; what it finds is compared again with the
embeddings as they are on disk.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.similarity.embedding import DIMENSIONS

#: Models that FAISS's answer is cut to before they are compared exactly, in multiples of those asked for.
_SPARE = 2
#: Models that are worked on at once.
_BLOCK = 4096


class VectorIndex:
    """Models by their views.

    Args:
        embeddings: (M, V, 128) float16, in parts that are joined in order.
        categories: (M) the category of each model.

    Raises:
        DependencyError: FAISS is not installed.
    """

    def __init__(self, embeddings: Sequence[NDArray[np.float16]], categories: Sequence[str]) -> None:
        try:
            import faiss
        except ImportError as error:
            raise DependencyError(
                "the view index needs FAISS: install it with `pip install 'cadpose[index]'`"
            ) from error
        self._parts = [part for part in embeddings if len(part)]
        self._starts = np.cumsum([0, *(len(part) for part in self._parts)])
        named = np.array(categories, object)
        #: Models in the order in which FAISS has them.
        self._order = np.argsort(named.astype(str), kind="stable").astype(np.int64)
        ordered = named[self._order]
        self._ranges: dict[str, tuple[int, int]] = {}
        for name in sorted(set(categories)):
            (where,) = np.nonzero(ordered == name)
            self._ranges[name] = int(where[0]), int(where[-1]) + 1
        self._search_parameters: Any = faiss.SearchParameters
        self._selector = faiss.IDSelectorRange
        self._faiss: list[Any] = []
        if not self._parts:
            return
        # One query has nothing to share out, and waiting threads cost more than they save.
        faiss.omp_set_num_threads(1)
        low = np.min([part.min(axis=(0, 1)) for part in self._parts], axis=0)
        high = np.max([part.max(axis=(0, 1)) for part in self._parts], axis=0)
        span = np.stack([low, high]).astype(np.float32)
        for _ in range(self._parts[0].shape[1]):
            index = faiss.IndexScalarQuantizer(
                DIMENSIONS, faiss.ScalarQuantizer.QT_8bit, faiss.METRIC_INNER_PRODUCT
            )
            index.train(span)
            self._faiss.append(index)
        for first in range(0, len(self), _BLOCK):
            own = self.gather(self._order[first : first + _BLOCK])
            for view, index in enumerate(self._faiss):
                index.add(np.ascontiguousarray(own[:, view], np.float32))

    def __len__(self) -> int:
        return int(self._starts[-1])

    def gather(self, rows: NDArray[np.int64]) -> NDArray[np.float16]:
        """(R, V, 128) embeddings of these models."""
        part = np.searchsorted(self._starts, rows, side="right") - 1
        out = np.empty((len(rows), *self._parts[0].shape[1:]), np.float16)
        for i in np.unique(part):
            here = part == i
            out[here] = self._parts[i][rows[here] - self._starts[i]]
        return out

    def search(
        self, query: NDArray[np.float32], views: NDArray[np.int64], category: str | None, count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """The models whose best view among ``views`` is nearest.

        Args:
            query: (128,) of unit length.
            views: Which views take part.
            category: Only models of this category; of all if None.
            count: How many models at most.

        Returns:
            (K,) models, nearest first, and (K, len(views)) the cosine of each of their views.
        """
        first, last = self._range(category)
        if first == last:
            return np.zeros(0, np.int64), np.zeros((0, len(views)), np.float32)
        wanted = _SPARE * count
        parameters = (
            self._search_parameters(sel=self._selector(first, last)) if category is not None else None
        )
        found, cosines = [], []
        for view in views:
            near, which = self._faiss[int(view)].search(
                query[None], min(wanted, last - first), params=parameters
            )
            found.append(self._order[which[0]])
            cosines.append(near[0])
        flat, near = np.concatenate(found), np.concatenate(cosines)
        order = np.argsort(-near, kind="stable")
        # The first of a model's places is that of its best view.
        _, place = np.unique(flat[order], return_index=True)
        return self._best(query, views, flat[order][np.sort(place)[:wanted]], count)

    def exact(
        self, query: NDArray[np.float32], views: NDArray[np.int64], category: str | None, count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """As :meth:`search`, comparing with every model: what it is measured against."""
        first, last = self._range(category)
        if first == last:
            return np.zeros(0, np.int64), np.zeros((0, len(views)), np.float32)
        rows = np.sort(self._order[first:last])
        return self._best(query, views, rows, count)

    def _range(self, category: str | None) -> tuple[int, int]:
        """Where FAISS has the models of a category."""
        return (0, len(self)) if category is None else self._ranges.get(category, (0, 0))

    def _best(
        self, query: NDArray[np.float32], views: NDArray[np.int64], rows: NDArray[np.int64], count: int
    ) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        cosines = np.concatenate(
            [
                self.gather(block)[:, views].astype(np.float32) @ query
                for block in np.array_split(rows, -(-len(rows) // _BLOCK))
            ]
        )
        # Equal ones in order of their rows.
        order = np.lexsort((rows, -cosines.max(axis=1)))[:count]
        return rows[order], cosines[order]
