"""Pictures that are kept: bytes in memory, the least used ones going first, and on disk where told."""

from __future__ import annotations

import hashlib
import logging
import os
import threading
from collections import OrderedDict
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar

from cadpose.library.storage import write_atomic

log = logging.getLogger(__name__)

T = TypeVar("T")
#: Files after which the folder is tidied.
_TIDY_EVERY = 200


class Kept(Generic[T]):
    """Things by key, at most so many bytes of them; each is made once, by one thread.

    Args:
        most: Bytes.
        size: Bytes of one.
    """

    def __init__(self, most: int, size: Callable[[T], int]) -> None:
        self.most, self._size = most, size
        self._held: OrderedDict[str, T] = OrderedDict()
        self._bytes = 0
        self._lock = threading.Lock()
        self._making: dict[str, threading.Lock] = {}

    def get(self, key: str) -> T | None:
        """The thing of that key if it is held."""
        with self._lock:
            found = self._held.get(key)
            if found is not None:
                self._held.move_to_end(key)
            return found

    def put(self, key: str, thing: T) -> None:
        """Hold a thing; others may go for it."""
        with self._lock:
            old = self._held.pop(key, None)
            self._bytes += self._size(thing) - (0 if old is None else self._size(old))
            self._held[key] = thing
            while self._bytes > self.most and len(self._held) > 1:
                _, gone = self._held.popitem(last=False)
                self._bytes -= self._size(gone)

    def made(self, key: str, make: Callable[[], T]) -> T:
        """The thing of that key, made if need be; another thread that makes it is waited for."""
        found = self.get(key)
        if found is not None:
            return found
        with self._lock:
            making = self._making.setdefault(key, threading.Lock())
        with making:
            try:
                found = self.get(key)
                if found is None:
                    found = make()
                    self.put(key, found)
                return found
            finally:
                with self._lock:
                    self._making.pop(key, None)


class KeptPictures:
    """Encoded pictures in memory, and in a folder between starts.

    Args:
        memory: Most bytes in memory.
        folder: Where; None keeps none on disk.
        disk: Most bytes on disk, the oldest going first.
    """

    def __init__(self, memory: int, folder: Path | None = None, disk: int = 2**30) -> None:
        self.folder, self.disk = folder, disk
        self._memory: Kept[bytes] = Kept(memory, len)
        self._written = 0

    def made(self, key: str, make: Callable[[], bytes]) -> bytes:
        """The picture of that key, made if need be."""
        return self._memory.made(key, lambda: self._from_disk(key, make))

    def _from_disk(self, key: str, make: Callable[[], bytes]) -> bytes:
        if self.folder is None:
            return make()
        name = hashlib.sha256(key.encode()).hexdigest()[:32]
        path = self.folder / name[:2] / f"{name}.bin"
        with suppress(OSError):
            data = path.read_bytes()
            # Read again later, so kept longer.
            os.utime(path)
            return data
        data = make()
        try:
            # Photos are private: the folder is the user's own.
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            write_atomic(path, data)
        except OSError as error:
            # Without a cache the work is slower, not wrong.
            log.info("pictures cannot be kept in %s (%s)", self.folder, error)
            return data
        self._written += 1
        if self._written % _TIDY_EVERY == 1:
            _tidy(self.folder, self.disk)
        return data


def _tidy(folder: Path, most: int) -> None:
    """Delete the files longest unused until the others have ``most`` bytes."""
    files = []
    for path in folder.glob("*/*.bin"):
        with suppress(OSError):
            status = path.stat()
            files.append((status.st_mtime, status.st_size, path))
    total = 0
    for _, size, path in sorted(files, reverse=True):
        total += size
        if total > most:
            path.unlink(missing_ok=True)
