"""Photos found by content: a store knows names and digests only, and only named folders are looked into.

A file counts when its real path lies in one of the folders and its bytes have the wanted digest. Its name is
tried first; then a digest index of the folders, built by a thread of its own when a name first fails.
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

from cadpose.annotations.formats.target import portable_name
from cadpose.batch.photo_files import file_mark, photo_digest
from cadpose.errors import CadposeError, InputError
from cadpose.photos import MAX_BYTES, SUFFIXES, read_photo
from cadpose.records import Photo

log = logging.getLogger(__name__)

#: Files of the folders that are looked at, and bytes of them that are read, in one walk.
MOST_FILES = 50_000
MOST_BYTES = 32 * 2**30
#: Seconds after which folders are walked again for a photo that was not there.
FRESH = 20.0
#: Longest that a request waits for a walk to end.
PATIENCE = 4.0

_Mark = tuple[int, int]


class PhotoFiles:
    """Finds photos.

    Args:
        folders: Where photos may be read; those that are missing are left out until they are made.
        uploads: The folder of uploads among them, whose names are their digests.
    """

    def __init__(self, folders: Sequence[Path], uploads: Path) -> None:
        self.folders, self.uploads = tuple(folders), uploads
        self._lock = threading.Lock()
        # Digest of each file looked at, as long as the file is unchanged.
        self._digests: dict[Path, tuple[_Mark, str]] = {}
        self._found: dict[str, Path] = {}
        self._walk: threading.Thread | None = None
        self._walked = -FRESH

    def path(self, sha256: str, name: str, *, patience: float = 0.0, walk: bool = True) -> Path | None:
        """The file with these bytes; None where it is not at hand, or not found yet.

        Args:
            sha256: Digest of its bytes.
            name: As the store has it.
            patience: Seconds to wait for the folders to be walked through.
            walk: Whether they are, where the name leads nowhere.
        """
        known = self._known(sha256)
        if known is not None:
            return known
        for path in self._named(sha256, name):
            if self._is(path, sha256):
                self._found[sha256] = path
                return path
        walking = self._walking() if walk else None
        if walking is not None and patience > 0.0:
            walking.join(patience)
        return self._known(sha256)

    def read(self, sha256: str, name: str) -> Photo:
        """The decoded photo.

        Raises:
            InputError: it is not at hand.
        """
        path = self.path(sha256, name, patience=PATIENCE)
        photo = None if path is None else _decoded(path)
        if photo is None or photo.sha256 != sha256:
            raise InputError(
                f"the photo {name} is not at hand: start `cadpose review` with --photos and its folder"
            )
        return photo

    def _known(self, sha256: str) -> Path | None:
        """Where it was found before; forgotten once the file is gone, so that a walk finds it anew."""
        known = self._found.get(sha256)
        if known is None or self._is(known, sha256):
            return known
        if self._found.get(sha256) == known:
            self._found.pop(sha256, None)
        return None

    def _named(self, sha256: str, name: str) -> Iterator[Path]:
        """Places where a photo of that name may lie."""
        yield from (self.uploads / f"{sha256}{suffix}" for suffix in sorted(SUFFIXES))
        pieces = portable_name(name).split("/")
        for folder in self.folders:
            for start in range(len(pieces)):
                yield folder.joinpath(*pieces[start:])

    def _is(self, path: Path, sha256: str) -> bool:
        return self._inside(path) and self._digest(path) == sha256

    def _inside(self, path: Path) -> bool:
        """Whether a file is there and really lies in a folder, links followed."""
        try:
            if not path.is_file():
                return False
            place = Path(os.path.realpath(path))
            return any(place.is_relative_to(os.path.realpath(folder)) for folder in self.folders)
        except (OSError, ValueError):
            return False

    def _digest(self, path: Path) -> str:
        mark = file_mark(path)
        known = self._digests.get(path)
        if known is not None and known[0] == mark:
            return known[1]
        if not 0 < mark[0] <= MAX_BYTES:
            return ""
        digest = photo_digest(path)
        self._digests[path] = mark, digest
        return digest

    def _walking(self) -> threading.Thread | None:
        """The thread that walks through the folders, begun where the last one is long ago."""
        with self._lock:
            if self._walk is not None and self._walk.is_alive():
                return self._walk
            if time.monotonic() - self._walked < FRESH:
                return None
            self._walk = threading.Thread(target=self._index, name="photo-index", daemon=True)
            self._walk.start()
            return self._walk

    def _index(self) -> None:
        """Read what is new in the folders."""
        files = read = 0
        try:
            for path in self._photos():
                files += 1
                if path not in self._digests:
                    read += file_mark(path)[0]
                if files > MOST_FILES or read > MOST_BYTES:
                    log.warning("only %d files of the photo folders are looked through", files - 1)
                    return
                digest = self._digest(path) if self._inside(path) else ""
                if digest:
                    self._found[digest] = path
        finally:
            self._walked = time.monotonic()

    def _photos(self) -> Iterator[Path]:
        for folder in self.folders:
            for place, inner, names in os.walk(folder):
                # Hidden folders hold no photos of people, but caches and repositories.
                inner[:] = sorted(name for name in inner if not name.startswith("."))
                for name in sorted(names):
                    path = Path(place, name)
                    if path.suffix.lower() in SUFFIXES and not name.startswith("."):
                        yield path


def _decoded(path: Path) -> Photo | None:
    try:
        return read_photo(path)
    except CadposeError as error:
        log.info("%s", error)
        return None
