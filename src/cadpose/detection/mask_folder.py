"""Detections from a folder of PNG masks named after the photos.

``street.png`` or ``street.jpg.png`` belongs to ``street.jpg``. The category is that of the name,
``street.CATEGORY.png``, else that of a folder, ``CATEGORY/street.png``, else the one asked for; where nothing
tells it, EfficientNet-Lite0 names the object. A number may tell files apart: ``street.CATEGORY.2.png``.
A word is a category where the class map knows it or it is asked for; other words are part of the photo's
name, and other folders are its folder: ``trip/street.png`` belongs to ``trip/street.jpg`` alone.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

from cadpose.detection.coco import is_living
from cadpose.detection.given import named_detection
from cadpose.detection.mask_png import read_masks
from cadpose.detection.photo_names import path_parts
from cadpose.detection.reading import is_wanted
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import category_from_name, category_or_word
from cadpose.records import Detection, Photo

#: Most files that a folder of masks may hold, its sub-folders included.
MAX_FILES = 200_000
# What may follow the photo's name: a word that is no number, and a number.
_REST = re.compile(r"(?:\.(?P<word>[^.]*[^.\d][^.]*))?(?:\.\d+)?")


@dataclass(frozen=True, slots=True)
class _File:
    """A mask file as one photo's.

    Attributes:
        path: Where it lies.
        word: The category that it tells, empty without.
        place: The folder that its photo lies in, empty where any will do.
    """

    path: Path
    word: str
    place: str


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
            told, place = (level, "") if self._is_category(level) else ("", level)
            # Every way to read the name: street.car is a photo, or a mask of street whose category is car.
            pieces = path.stem.split(".")
            for end in range(len(pieces), max(len(pieces) - 3, 0), -1):
                rest = "".join(f".{piece}" for piece in pieces[end:])
                match = _REST.fullmatch(rest)
                if match and (match["word"] is None or self._is_category(match["word"])):
                    file = _File(path, match["word"] or told, place)
                    self._files.setdefault(".".join(pieces[:end]), []).append(file)

    def detect(self, photo: Photo) -> list[Detection]:
        """The objects of the photo's masks, by file name and value; empty where there is no mask.

        Raises:
            InputError: a mask cannot be used or does not fit the photo, there are too many, its category is
                not told, or the photo's folder is not told and masks of several would fit.
        """
        found: list[Detection] = []
        files = self._of(photo.name)
        places = sorted({file.place for file in files if file.place})
        if len(places) > 1:
            raise InputError(
                f"{self.path} has masks of {photo.name} in several folders, {', '.join(places)}: "
                f"name the photo with its folder."
            )
        for file in files:
            if file.word and not is_wanted(file.word, self.categories):
                continue
            word = file.word or self._only(file.path)
            found += [
                named_detection(photo, Box.from_mask(mask), word, mask=mask, source="file")
                for mask in read_masks(file.path, photo, before=len(found))
            ]
        return found

    def knows(self, photo_name: str) -> bool:
        """Whether a mask is named after the photo."""
        return bool(self._of(photo_name))

    def _of(self, photo_name: str) -> list[_File]:
        *folders, name = path_parts(photo_name)
        named = [file for key in dict.fromkeys((Path(name).stem, name)) for file in self._files.get(key, ())]
        # A photo that is named without a folder may lie in any.
        return [file for file in named if not file.place or not folders or file.place == folders[-1]]

    def _is_category(self, word: str) -> bool:
        """Whether a word of a path tells what a mask shows."""
        known = bool(category_from_name(word)) or is_living(word.strip().lower())
        return known or (bool(word) and category_or_word(word) in (self.categories or ()))

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
