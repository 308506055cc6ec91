"""What waits to be annotated, noted on disk, so that a server that is started again goes on with it."""

from __future__ import annotations

import logging
import re
from pathlib import Path

from cadpose.library.storage import write_atomic

log = logging.getLogger(__name__)

_BEGIN = ".waiting-"
_FILE = re.compile(r"^\.waiting-([0-9a-f]{64})$")
#: Longest name of a photo, in bytes.
_MOST_BYTES = 4000


class WaitingNotes:
    """A file for each photo that waits: its digest in the file's name, the photo's name inside.

    Args:
        folder: Where they are, the folder of uploads; made when the first is written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def add(self, sha256: str, name: str) -> None:
        """Note a photo; where that cannot be written it is annotated all the same."""
        try:
            write_atomic(self.folder / f"{_BEGIN}{sha256}", name.encode(errors="replace"))
        except OSError as error:
            log.warning("it cannot be noted that %s waits: %s", name, error)

    def drop(self, sha256: str) -> None:
        """It does not wait any more."""
        try:
            (self.folder / f"{_BEGIN}{sha256}").unlink(missing_ok=True)
        except OSError as error:
            log.warning("%s", error)

    def all(self, most: int) -> list[tuple[str, str]]:
        """(digest, name) of those that wait, the first one first; at most so many."""
        found = []
        try:
            for path in self.folder.glob(f"{_BEGIN}*"):
                told = _FILE.match(path.name)
                if told is not None and path.is_file():
                    found.append((path.stat().st_mtime_ns, told[1], path))
            oldest = sorted(found)[:most]
            return [(sha256, _name(path) or sha256) for _, sha256, path in oldest]
        except OSError as error:
            log.warning("photos that waited cannot be looked up: %s", error)
            return []


def _name(path: Path) -> str:
    with path.open("rb") as file:
        name = file.read(_MOST_BYTES).decode(errors="replace")
    return "".join(c for c in name if c.isprintable())
