"""An index on disk: segments that are never changed, and one manifest that says which of them count.

A segment's files are written and flushed first, then the manifest is put in place in one step, then what is
no longer named is deleted. Whatever ends a run, the manifest names whole segments; what it does not name is
swept away by the next commit.
"""

from __future__ import annotations

import errno
import io
import json
import re
import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError, LibraryError
from cadpose.library.storage import sha256_of, write_atomic
from cadpose.similarity.embedding import DIMENSIONS
from cadpose.similarity.small_maps import CELLS, CHANNELS

MANIFEST, _LOCK = "index.json", "lock"
FORMAT = 1
_MOST_JSON_BYTES = 256 * 2**20
#: How often a reader begins anew because a writer has meanwhile replaced what it was to read.
_TRIES = 3
#: File of each array; the maps are left on disk until they are asked for.
_PARTS = ("embeddings", "cells", "aspects")
#: The only names that are ever deleted: a segment's files, and what a killed `write_atomic` left.
_OWN = re.compile(r"(\d{6})\.(?:json|(?:embeddings|cells|aspects)\.npy)")
_TEMPORARY = re.compile(r"\.part-[a-z0-9_]{8}")


@dataclass(frozen=True, slots=True)
class Entry:
    """One model as the index knows it: it is described anew when any of these changes."""

    id: str
    category: str
    sha256: str


@dataclass(frozen=True, eq=False)
class Segment:
    """M described models of V views each.

    Attributes:
        entries: The models.
        embeddings: (M, V, 128) float16.
        cells: (M, V, 7, 7, 25) int8, read from disk as needed.
        aspects: (M, V) float32.
    """

    entries: tuple[Entry, ...]
    embeddings: NDArray[np.float16]
    cells: NDArray[np.int8]
    aspects: NDArray[np.float32]

    def kept(self, wanted: Collection[Entry]) -> Segment:
        """The part whose models are among the wanted ones."""
        rows = [i for i, entry in enumerate(self.entries) if entry in wanted]
        return Segment(
            tuple(self.entries[i] for i in rows),
            self.embeddings[rows],
            self.cells[rows],
            self.aspects[rows],
        )

    @classmethod
    def joined(cls, parts: Sequence[Segment]) -> Segment:
        """All parts in order."""
        return cls(
            tuple(entry for part in parts for entry in part.entries),
            np.concatenate([part.embeddings for part in parts]),
            np.concatenate([part.cells for part in parts]),
            np.concatenate([part.aspects for part in parts]),
        )


class SegmentStore:
    """The folder. Make one with `open` or `create`.

    Attributes:
        folder: Where it is.
        settings: Everything that decided what is kept of a model.
    """

    def __init__(self, folder: Path, settings: Mapping[str, Any], segments: dict[str, str]) -> None:
        self.folder = folder
        self.settings = dict(settings)
        self._segments = segments  # name -> SHA-256 of its JSON

    @classmethod
    def open(cls, folder: Path) -> SegmentStore:
        """Open an index that is there.

        Raises:
            LibraryError: there is none, or its manifest is damaged.
        """
        path = folder / MANIFEST
        if not path.is_file():
            raise LibraryError(f"There is no view index at {folder}; make it with `cadpose library index`.")
        try:
            told = json.loads(_bounded(path))
            if told["format"] != FORMAT:
                raise LibraryError(
                    f"The view index {folder} was made by another version of cadpose; delete it and run "
                    "`cadpose library index`."
                )
            segments = {str(name): str(digest) for name, digest in told["segments"].items()}
            if not all(name.isdecimal() for name in segments):
                raise ValueError("a segment's name is no number")
            return cls(folder, dict(told["settings"]), segments)
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise _damaged(path, error) from error

    @classmethod
    def create(cls, folder: Path, settings: Mapping[str, Any]) -> SegmentStore:
        """An empty index in a folder that is new or empty.

        Raises:
            InputError: the folder holds something else.
            OSError: it cannot be written.
        """
        _refuse_others(folder)
        store = cls(folder, settings, {})
        store.commit()
        return store

    @property
    def names(self) -> tuple[str, ...]:
        """The segments in the order in which they were made."""
        return tuple(self._segments)

    @property
    def nbytes(self) -> int:
        """Length of all its files."""
        return sum(path.stat().st_size for path in self.folder.iterdir() if path.is_file())

    def read(self, name: str) -> Segment:
        """One segment, checked: its embeddings by checksum, its maps by length.

        Raises:
            LibraryError: a file of it is missing, cut short or changed.
        """
        path = self._path(name, "json")
        try:
            data = _bounded(path)
            if sha256_of(data) != self._segments[name]:
                raise ValueError("SHA-256 differs")
            told = json.loads(data)
            arrays = {}
            for part in _PARTS:
                path = self._path(name, part)
                size, checksum = told["files"][part]
                if path.stat().st_size != size:
                    raise ValueError(f"{path.stat().st_size} bytes instead of {size}")
                if part == "cells":
                    arrays[part] = np.load(path, mmap_mode="r", allow_pickle=False)
                    continue
                # A map keeps its file open, and a process may open but so many.
                data = path.read_bytes()
                if zlib.crc32(data) != checksum:
                    raise ValueError("checksum differs")
                arrays[part] = np.load(io.BytesIO(data), allow_pickle=False)
            return Segment(
                tuple(Entry(*map(str, row)) for row in told["models"]),
                arrays["embeddings"],
                arrays["cells"],
                arrays["aspects"],
            )
        except (OSError, ValueError, KeyError, TypeError, EOFError, AttributeError) as error:
            raise _damaged(path, error) from error

    def read_all(self) -> list[Segment]:
        """Every segment, of the manifest as it is now where a writer has meanwhile deleted one.

        Raises:
            LibraryError: a file of one is missing, cut short or changed.
        """
        for _ in range(_TRIES - 1):
            try:
                return [self.read(name) for name in self.names]
            except LibraryError as error:
                if not isinstance(error.__cause__, FileNotFoundError):
                    raise
                self._segments = SegmentStore.open(self.folder)._segments
        return [self.read(name) for name in self.names]

    def check(self, name: str) -> None:
        """Read all of a segment, the maps too.

        Raises:
            LibraryError: a file of it is missing, cut short or changed.
        """
        self.read(name)
        path = self._path(name, "cells")
        checksum = json.loads(self._path(name, "json").read_bytes())["files"]["cells"][1]
        if zlib.crc32(path.read_bytes()) != checksum:
            raise _damaged(path, ValueError("checksum differs"))

    def commit(self, add: Sequence[Segment] = (), drop: Collection[str] = ()) -> None:
        """Add segments and drop others, all at once or not at all.

        Raises:
            OSError: the folder cannot be written.
        """
        segments = {name: digest for name, digest in self._segments.items() if name not in drop}
        number = max((int(name) for name in self._segments), default=0)
        for segment in add:
            number += 1
            segments[f"{number:06d}"] = self._write(f"{number:06d}", segment)
        told = {"format": FORMAT, "settings": self.settings, "segments": segments}
        write_atomic(self.folder / MANIFEST, (json.dumps(told, indent=1) + "\n").encode())
        self._segments = segments
        for path in self.folder.iterdir():
            own = _OWN.fullmatch(path.name)
            if (own and own[1] not in segments) or _TEMPORARY.fullmatch(path.name):
                path.unlink(missing_ok=True)

    @staticmethod
    @contextmanager
    def locked(folder: Path) -> Iterator[None]:
        """Keep other processes from writing meanwhile; the system frees the lock of one that is killed.

        Args:
            folder: Of the index; made when needed.

        Raises:
            InputError: the folder holds something else.
            LibraryError: another process writes now.
            OSError: the folder cannot be written.
        """
        folder.mkdir(parents=True, exist_ok=True)
        if not (folder / MANIFEST).exists():
            # Before the lock's own file is left in somebody's folder.
            _refuse_others(folder)
        with (folder / _LOCK).open("ab") as file:
            try:
                import fcntl
            except ImportError:  # Windows
                yield
                return
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise LibraryError(
                    f"Another process is writing the view index {folder}; wait until it has ended."
                ) from None
            yield

    def _write(self, name: str, segment: Segment) -> str:
        arrays: dict[str, NDArray[Any]] = {
            "embeddings": segment.embeddings,
            "cells": segment.cells,
            "aspects": segment.aspects,
        }
        m, v = segment.aspects.shape
        shapes = {"embeddings": (m, v, DIMENSIONS), "cells": (m, v, CELLS, CELLS, CHANNELS + 1)}
        if len(segment.entries) != m or any(arrays[part].shape != shapes[part] for part in shapes):
            raise ValueError(f"a segment's arrays do not fit together: {m} models of {v} views")
        files_told = {}
        for part, array in arrays.items():
            out = io.BytesIO()
            np.save(out, array, allow_pickle=False)
            data = out.getvalue()
            write_atomic(self._path(name, part), data)
            files_told[part] = [len(data), zlib.crc32(data)]
        told = {
            "models": [[e.id, e.category, e.sha256] for e in segment.entries],
            "files": files_told,
        }
        data = json.dumps(told).encode()
        write_atomic(self._path(name, "json"), data)
        return sha256_of(data)

    def _path(self, name: str, part: str) -> Path:
        return self.folder / (f"{name}.json" if part == "json" else f"{name}.{part}.npy")


def _bounded(path: Path) -> bytes:
    if path.stat().st_size > _MOST_JSON_BYTES:
        raise ValueError("far too large")
    return path.read_bytes()


def _refuse_others(folder: Path) -> None:
    """An index begins in a folder that is new or empty: nothing of anybody's is to be among its files."""
    for path in sorted(folder.iterdir()) if folder.exists() else ():
        if path.name != _LOCK and not _TEMPORARY.fullmatch(path.name):
            raise InputError(f"{folder} holds something else ({path.name}): name a new folder for the index")


def _damaged(path: Path, error: Exception) -> LibraryError:
    if isinstance(error, OSError) and error.errno in (errno.EMFILE, errno.ENFILE):
        return LibraryError(
            f"The view index {path.parent} has more files than may be open at once; allow more, as by "
            "`ulimit -n 4096`."
        )
    reason = error.strerror if isinstance(error, OSError) else error
    return LibraryError(
        f"The view index is damaged: {path} ({reason}); delete the folder {path.parent} and run "
        "`cadpose library index` again."
    )
