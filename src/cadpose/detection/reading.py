"""What every reader of others' detections shares: limits before anything is unpacked, and categories."""

from __future__ import annotations

import stat
from collections.abc import Collection
from pathlib import Path

from cadpose.detection.coco import is_living
from cadpose.errors import InputError
from cadpose.library.class_map import category_or_word
from cadpose.records import Photo

#: Most bytes that the masks of one photo's objects may take in memory, a byte a pixel.
MAX_MASK_BYTES = 10**9


def read_capped(path: Path, limit: int, kind: str) -> bytes:
    """A regular file's bytes.

    Args:
        path: The file.
        limit: Most bytes that are read.
        kind: What the file should be, as ``"a detections file"``, for the message.

    Raises:
        InputError: it cannot be read, is no regular file, or is larger.
    """
    # One more than the limit, since a file's size may be told wrong, or grow.
    data = read_start(path, limit + 1, kind)
    if len(data) > limit:
        raise InputError(f"{path} is larger than the limit of {limit // 2**20} MB: split it.")
    return data


def read_start(path: Path, count: int, kind: str) -> bytes:
    """The first ``count`` bytes of a regular file, or all where it has fewer.

    Raises:
        InputError: it cannot be read or is no regular file.
    """
    try:
        # Looked at before it is opened: a pipe would wait for a writer.
        if not stat.S_ISREG(path.stat().st_mode):
            raise InputError(f"{path} cannot be read (it is not a file): name {kind}.")
        with path.open("rb") as file:
            return file.read(count)
    except (OSError, ValueError) as error:  # ValueError: a name with a null character
        reason = getattr(error, "strerror", None) or type(error).__name__
        raise InputError(f"{path} cannot be read ({reason}): name {kind}.") from None


def most_masks(width: int, height: int) -> int:
    """How many masks of a photo of that size are held: those that ``MAX_MASK_BYTES`` holds, or one."""
    return max(MAX_MASK_BYTES // (width * height), 1)


def check_room(origin: Path | str, count: int, photo: Photo, before: int = 0) -> None:
    """Refuse more masks of a photo than memory should hold.

    Args:
        origin: What brings them, for the message.
        count: How many it brings.
        photo: Their photo.
        before: How many of the photo there are already.

    Raises:
        InputError: so many masks of the photo's size exceed ``MAX_MASK_BYTES``.
    """
    most = most_masks(photo.width, photo.height)
    if before + count > most:
        besides = f" besides {before} from elsewhere" if before else ""
        raise InputError(
            f"{origin} has {count} masks of {photo.name}{besides}, and at its size no more than {most} are "
            f"taken: leave some out, or make the photo smaller."
        )


def is_wanted(word: str, categories: Collection[str] | None) -> bool:
    """Whether objects of that class are taken: those asked for, else all but people, animals and food."""
    category = category_or_word(word)
    return not is_living(category) if categories is None else category in categories
