"""Photos by the names that a detections file gives them."""

from __future__ import annotations

from pathlib import Path, PurePosixPath
from typing import Generic, TypeVar

from cadpose.errors import InputError

_T = TypeVar("_T")


class PhotoIndex(Generic[_T]):
    """Entries of a file, found by a photo's name, and by its folders where names repeat.

    Args:
        path: The file, for the message.
        mend: What the user may do where folders do not tell two photos apart.
    """

    def __init__(self, path: Path, mend: str) -> None:
        self.path, self.mend = path, mend
        self._entries: dict[str, list[tuple[tuple[str, ...], _T]]] = {}

    def add(self, name: str, entry: _T) -> None:
        """An entry under the name that the file gives its photo."""
        parts = path_parts(name)
        self._entries.setdefault(parts[-1], []).append((parts, entry))

    def has(self, photo_name: str) -> bool:
        """Whether any entry has the photo's file name."""
        return path_parts(photo_name)[-1] in self._entries

    def find(self, photo_name: str) -> _T | None:
        """The entry whose path agrees with the photo's the furthest, from the file name upwards.

        Raises:
            InputError: several do.
        """
        parts = path_parts(photo_name)
        entries = self._entries.get(parts[-1], [])
        agreement = [_common_tail(parts, theirs) for theirs, _ in entries]
        best = [e for (_, e), a in zip(entries, agreement, strict=True) if a == max(agreement)]
        if len(best) > 1:
            raise InputError(f"{self.path} has several images {parts[-1]}: {self.mend}.")
        return best[0] if best else None


def path_parts(name: str) -> tuple[str, ...]:
    """Path pieces without dots and roots, at least one; separators of either kind."""
    pieces = PurePosixPath(name.replace("\\", "/")).parts
    return tuple(p for p in pieces if p not in ("/", ".", "..")) or (name,)


def _common_tail(a: tuple[str, ...], b: tuple[str, ...]) -> int:
    """Number of equal pieces from the end."""
    count = 0
    for x, y in zip(reversed(a), reversed(b), strict=False):
        if x != y:
            break
        count += 1
    return count
