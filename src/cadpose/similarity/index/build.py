"""Bring an index up to date with a library: only what is new or has changed is drawn."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from cadpose.errors import LibraryError
from cadpose.library.catalogue import Library
from cadpose.rendering.scene import Scene, build_scene
from cadpose.similarity.embedding import DIMENSIONS
from cadpose.similarity.index.describe import DescribedModel, ViewDescriber
from cadpose.similarity.index.segments import MANIFEST, Entry, Segment, SegmentStore
from cadpose.similarity.small_maps import CELLS, CHANNELS

#: Models a segment: so many are done anew after a kill, at most.
SEGMENT = 256
#: So many segments of less than half that size are joined into full ones.
_SMALL_SEGMENTS = 8


class Source(Protocol):
    """Where the models come from."""

    def entries(self) -> Sequence[Entry]:
        """Every model."""
        ...

    def scene(self, entry: Entry) -> Scene:
        """A model as it is drawn; called from several threads.

        Raises:
            LibraryError: its file is damaged.
        """
        ...


class LibrarySource:
    """The models of a library."""

    def __init__(self, library: Library) -> None:
        self._library = library

    def entries(self) -> list[Entry]:
        """Every model, in order of id."""
        return [Entry(m.id, m.category, m.sha256) for m in self._library.models()]

    def scene(self, entry: Entry) -> Scene:
        """A model as it is drawn."""
        return build_scene(self._library.mesh(entry.id))


@dataclass(frozen=True)
class IndexReport:
    """What :func:`build_index` did.

    Attributes:
        added: Ids of models described now.
        removed: Ids of models that left.
        unchanged: How many were there.
        failed: (id, reason) of models that cannot be described.
        models: How many the index holds now.
        nbytes: Its size on disk.
    """

    added: tuple[str, ...]
    removed: tuple[str, ...]
    unchanged: int
    failed: tuple[tuple[str, str], ...]
    models: int
    nbytes: int


def build_index(
    folder: Path,
    source: Source,
    describer: ViewDescriber,
    *,
    categories: Collection[str] | None = None,
    workers: int = 1,
    progress: Callable[[int, int], None] = lambda done, total: None,
    committed: Callable[[int], None] = lambda models: None,
) -> IndexReport:
    """Make an index, or bring it up to date. A run that was killed goes on where it was.

    The content depends on the source and the describer alone, not on how often the run was ended. Models that
    fail are the exception: they are left out, and each later run tries them again.

    Args:
        folder: Of the index; made when needed.
        source: The models.
        describer: Draws and describes them.
        categories: Only models of these; what the index holds of others stays. None for all.
        workers: Threads; neither drawing nor networks hold Python's lock.
        progress: Told (models done, models in all) after each.
        committed: Told how many models a segment brought that is safe on disk now.

    Raises:
        InputError: the folder holds something that is no index.
        LibraryError: the index is damaged, was made with other settings, or is written by another process.
        OSError: the folder cannot be written.
        ValueError: ``workers`` is below 1.
    """
    if workers < 1:
        raise ValueError(f"workers must be at least 1, got {workers}")
    with SegmentStore.locked(folder):
        store = _opened(folder, describer)
        concerned = {e for e in source.entries() if categories is None or e.category in categories}
        removed = _drop_others(store, concerned, categories)
        there = {e for name in store.names for e in store.read(name).entries}
        todo = sorted(concerned - there, key=_order)
        unchanged, done, total = len(concerned & there), len(concerned & there), len(concerned)
        progress(done, total)
        added: list[str] = []
        failed: list[tuple[str, str]] = []
        with ThreadPoolExecutor(workers) as pool:
            for first in range(0, len(todo), SEGMENT):
                good: list[tuple[Entry, DescribedModel]] = []
                chunk = todo[first : first + SEGMENT]
                found = pool.map(lambda entry: _described(source, describer, entry), chunk)
                for entry, one in zip(chunk, found, strict=True):
                    if isinstance(one, str):
                        failed.append((entry.id, one))
                    else:
                        good.append((entry, one))
                    done += 1
                    progress(done, total)
                if good:
                    store.commit([_segment(good, len(describer.grid))])
                    added += [entry.id for entry, _ in good]
                    committed(len(good))
        _join_small(store)
    return IndexReport(
        tuple(sorted(added)),
        tuple(sorted(removed)),
        unchanged,
        tuple(sorted(failed)),
        sum(len(store.read(name).entries) for name in store.names),
        store.nbytes,
    )


def _opened(folder: Path, describer: ViewDescriber) -> SegmentStore:
    if not (folder / MANIFEST).is_file():
        return SegmentStore.create(folder, describer.settings)
    store = SegmentStore.open(folder)
    other = sorted(key for key, value in describer.settings.items() if store.settings.get(key) != value)
    if other:
        raise LibraryError(
            f"The view index {folder} was made with other settings ({', '.join(other)}); delete it, or name "
            "another folder with --index."
        )
    return store


def _drop_others(store: SegmentStore, concerned: set[Entry], categories: Collection[str] | None) -> list[str]:
    """Drop what has left the library or changed; ids of what left for good."""
    removed: list[str] = []
    ids = {entry.id for entry in concerned}
    add, drop = [], []
    for name in store.names:
        segment = store.read(name)
        # What is of another category may still be concerned: the library moved it.
        stay = {
            e for e in segment.entries
            if e in concerned or (categories is not None and e.category not in categories and e.id not in ids)
        }  # fmt: skip
        if len(stay) == len(segment.entries):
            continue
        removed += [e.id for e in segment.entries if e not in stay and e.id not in ids]
        drop.append(name)
        if stay:
            add.append(segment.kept(stay))
    if drop:
        store.commit(add, drop)
    return removed


def _described(source: Source, describer: ViewDescriber, entry: Entry) -> DescribedModel | str:
    """The model, or why it cannot be described."""
    try:
        return describer.describe(source.scene(entry))
    except (LibraryError, ValueError) as error:
        return str(error)


def _segment(described: Sequence[tuple[Entry, DescribedModel]], views: int) -> Segment:
    shape = (len(described), views)
    embeddings = np.empty((*shape, DIMENSIONS), np.float16)
    cells = np.empty((*shape, CELLS, CELLS, CHANNELS + 1), np.int8)
    aspects = np.empty(shape, np.float32)
    for i, (_, found) in enumerate(described):
        embeddings[i], cells[i], aspects[i] = found.embeddings, found.maps.cells, found.maps.aspect
    return Segment(tuple(entry for entry, _ in described), embeddings, cells, aspects)


def _join_small(store: SegmentStore) -> None:
    """Many small additions would leave many small files."""
    small = [name for name in store.names if len(store.read(name).entries) < SEGMENT // 2]
    if len(small) >= _SMALL_SEGMENTS:
        whole = Segment.joined([store.read(name) for name in small])
        store.commit(list(_cut(whole)), small)


def _cut(whole: Segment) -> Iterator[Segment]:
    for first in range(0, len(whole.entries), SEGMENT):
        part = slice(first, first + SEGMENT)
        yield Segment(
            whole.entries[part],
            whole.embeddings[part],
            whole.cells[part],
            whole.aspects[part],
        )


def _order(entry: Entry) -> tuple[str, str]:
    return entry.id, entry.sha256
