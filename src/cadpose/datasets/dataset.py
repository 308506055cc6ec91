"""A published data set on disk: which files to read, and how to read the labels of one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from cadpose.datasets.label import Label
from cadpose.datasets.label_json import library_category
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.records import Rotation

#: What PASCAL3D+ and its followers call things that no dictionary knows.
_CLASSES = {
    "diningtable": "table",
    "tvmonitor": "tv",
    "desk_lamp": "lamp",
    "filing_cabinet": "cabinet",
    "headphone": "headphones",
    "hair_dryer": "hair drier",
}


@dataclass(frozen=True)
class DataSet:
    """Labels of a data set, read file by file as they are asked for.

    Attributes:
        kind: As in `cadpose.datasets.registry.KINDS`.
        parts: What is read one after the other, for example annotation files.
        read: The labels of one part.
    """

    kind: str
    parts: Sequence[Any]
    read: Callable[[Any], Iterator[Label]]

    def __len__(self) -> int:
        return len(self.parts)

    def __iter__(self) -> Iterator[Label]:
        """Every label.

        Raises:
            InputError: a file cannot be used; the message names it.
        """
        return self.labels()

    def labels(
        self,
        on_bad: Callable[[InputError], None] | None = None,
        on_part: Callable[[], None] = lambda: None,
    ) -> Iterator[Label]:
        """Every label.

        Args:
            on_bad: Called with what is wrong with a part, whose labels are then left out. None raises.
            on_part: Called when a part has been read.

        Raises:
            InputError: as above, where ``on_bad`` is None.
        """
        for part in self.parts:
            try:
                # A part is taken whole or not at all.
                yield from list(self.read(part))
            except InputError as error:
                if on_bad is None:
                    raise
                on_bad(error)
            on_part()


def require_split(kind: str, split: str | None, splits: Sequence[str]) -> None:
    """Raise InputError unless the data set has that split."""
    if split is not None and split not in splits:
        has = f"it has {', '.join(splits)}" if splits else "it has none"
        raise InputError(f"{kind} has no split {split!r}: {has}")


def category_of(word: str) -> str:
    """Library category of a data set's class name; a class without one keeps its name."""
    return _CLASSES.get(word) or library_category(word)


def is_published_test(label: Label) -> bool:
    """Whether published figures count the object: unoccluded, untruncated, not difficult."""
    return not (label.occluded or label.truncated or label.difficult)


def rotation_of(azimuth: float, elevation: float, inplane: float) -> Rotation:
    """A rotation from any three angles in degrees, also with an elevation beyond ±90°.

    Raises:
        ValueError: an angle is not finite.
    """
    if -90.0 <= elevation <= 90.0:
        return Rotation(azimuth, elevation, inplane)
    if not abs(elevation) < 1e9:
        raise ValueError(f"elevation {elevation} is no angle")
    return Rotation.from_matrix(rotation_from_angles(azimuth, elevation, inplane))
