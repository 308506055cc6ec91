"""Detections from a folder of PNG masks named after the photos.

``car.png`` or ``car.jpg.png`` belongs to ``car.jpg``. The category is that of the name,
``car.CATEGORY.png``, else that of a folder, ``CATEGORY/car.png``, else the one asked for; where nothing tells
it, EfficientNet-Lite0 names the object. A number may tell files apart: ``car.CATEGORY.2.png``.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from cadpose.detection.given import named_detection
from cadpose.detection.mask_png import read_masks
from cadpose.detection.photo_names import path_parts
from cadpose.detection.reading import is_wanted
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import SUFFIXES
from cadpose.records import Detection, Photo

#: Most files that a folder of masks may hold, its sub-folders included.
MAX_FILES = 200_000
# What may follow the photo's name: a word that is no number, and a number.
_REST = re.compile(r"(?:\.(?P<word>[^.]*[^.\d][^.]*))?(?:\.\d+)?")


@dataclass(frozen=True, slots=True)
class _File:
    path: Path
    word: str


class MaskFolder:
    """Detections whose masks lie as PNG files in a folder; a detector like any other.

    Args:
        folder: The folder.
        categories: Library categories to keep, or the one of all masks that tell none; None keeps all but
            people, animals and food.

    Raises:
        InputError: the folder cannot be read, holds no PNG or far too many files.
    """

    name = "masks"

    def __init__(self, folder: Path | str, categories: Collection[str] | None = None) -> None:
        self.path = Path(folder)
        self.categories = None if categories is None else tuple(dict.fromkeys(categories))
        self._files: dict[str, list[_File]] = {}
        masks = [p for p in _listed(self.path) if p.suffix.lower() == ".png" and not p.name.startswith(".")]
        if not masks:
            raise InputError(f"the folder {self.path} holds no PNG: name the folder of the masks.")
        for path in sorted(masks):
            level = path.parent.name if path.parent != self.path else ""
            # Every way to read the name: car.v2 is a photo, or a mask of car whose category is v2.
            pieces = path.stem.split(".")
            for end in range(len(pieces), max(len(pieces) - 3, 0), -1):
                rest = "".join(f".{piece}" for piece in pieces[end:])
                match = _REST.fullmatch(rest)
                # car.jpg.png belongs to car.jpg and shows no jpg.
                if match and f".{match['word']}".lower() not in SUFFIXES:
                    file = _File(path, match["word"] or level)
                    self._files.setdefault(".".join(pieces[:end]), []).append(file)

    def detect(self, photo: Photo) -> list[Detection]:
        """The objects of the photo's masks, by file name and value; empty where there is no mask.

        Raises:
            InputError: a mask cannot be used or does not fit the photo, or its category is not told.
        """
        found: list[Detection] = []
        for file in self._of(photo.name):
            if file.word and not is_wanted(file.word, self.categories):
                continue
            word = file.word or self._only(file.path)
            found += [
                named_detection(photo, Box.from_mask(mask), word, mask=mask, source="file")
                for mask in read_masks(file.path, photo)
            ]
        return found

    def knows(self, photo_name: str) -> bool:
        """Whether a mask is named after the photo."""
        return bool(self._of(photo_name))

    def _of(self, photo_name: str) -> list[_File]:
        name = path_parts(photo_name)[-1]
        return [file for key in dict.fromkeys((Path(name).stem, name)) for file in self._files.get(key, ())]

    def _only(self, path: Path) -> str | None:
        """The category that was asked for, None without."""
        if self.categories is None:
            return None
        if len(self.categories) > 1:
            raise InputError(
                f"{path} does not tell which of {', '.join(self.categories)} it shows: call it "
                f"NAME.CATEGORY.png, or give --category once."
            )
        return self.categories[0]


def _listed(folder: Path) -> list[Path]:
    """The folder's files and those of its folders."""
    try:
        found = list(islice((p for pattern in ("*", "*/*") for p in folder.glob(pattern)), MAX_FILES + 1))
    except OSError as error:
        raise InputError(f"{folder} cannot be read ({error.strerror}): name a folder of masks.") from None
    if len(found) > MAX_FILES:
        raise InputError(f"{folder} holds more than {MAX_FILES} files: name the folder of the masks alone.")
    return found
