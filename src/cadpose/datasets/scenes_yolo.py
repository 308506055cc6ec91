"""YOLO's text labels: ``images/a.jpg`` beside ``labels/a.txt``, a line an object, in shares of the photo.

A line holds the class number, and either the box as middle x, middle y, width and height, or a polygon as x
and y of three corners or more. Classes are COCO's 80 unless ``classes.txt`` names others, one a line.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np

from cadpose.datasets.files import read_bytes, read_words
from cadpose.datasets.scenes import Scene, SceneSet, TrueObject, library_word
from cadpose.detection.coco import COCO_80
from cadpose.detection.polygons import mask_from_polygons
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.photos import find_photos
from cadpose.records import Mask, Photo

#: Folders of a data set, and its list of classes.
IMAGES, LABELS, CLASSES = "images", "labels", "classes.txt"
#: Largest label file, and most objects of a photo.
MAX_BYTES, MAX_OBJECTS = 16 * 2**20, 10_000

_Shares = tuple[float, ...]
_Line = tuple[str, _Shares]


def is_yolo(root: Path) -> bool:
    """Whether a folder has YOLO's two folders."""
    return (root / IMAGES).is_dir() and (root / LABELS).is_dir()


def yolo_scenes(root: Path) -> SceneSet:
    """A folder with ``images`` and ``labels``, either with folders of like names inside.

    A photo without a label file shows no object.

    Args:
        root: The folder.

    Raises:
        InputError: a folder is missing or empty, no photo has a label file, or a line is wrong.
    """
    if not is_yolo(root):
        raise InputError(f"{root}: holds no folders {IMAGES} and {LABELS}")
    names = COCO_80
    if (root / CLASSES).is_file():
        names = tuple(" ".join(words) for words in read_words(root / CLASSES))
    words = [library_word(name) for name in names]
    scenes, labelled = [], 0
    for photo in find_photos([root / IMAGES], recursive=True):
        file = (root / LABELS / photo.relative_to(root / IMAGES)).with_suffix(".txt")
        lines: list[_Line] = []
        if file.is_file():
            lines, labelled = _read(file, words), labelled + 1
        scenes.append(Scene(photo, partial(_objects, lines)))
    if not labelled:
        raise InputError(
            f"{root / LABELS}: holds no label of a photo in {root / IMAGES}, such as {photo.stem}.txt"
        )
    return SceneSet("yolo", root.resolve().name, scenes, frozenset(words))


def _read(file: Path, words: Sequence[str]) -> list[_Line]:
    try:
        text = read_bytes(file, MAX_BYTES).decode("ascii")
    except UnicodeDecodeError:
        raise InputError(f"{file}: is no list of numbers") from None
    rows = [(number, line.split()) for number, line in enumerate(text.splitlines(), 1) if line.strip()]
    if len(rows) > MAX_OBJECTS:
        raise InputError(f"{file}: holds more than {MAX_OBJECTS} objects")
    return [_line(f"{file}: line {number}", row, words) for number, row in rows]


def _line(where: str, row: Sequence[str], words: Sequence[str]) -> _Line:
    try:
        index, shares = int(row[0]), tuple(float(word) for word in row[1:])
    except ValueError:
        raise InputError(f"{where}: is not a class number and numbers") from None
    if not 0 <= index < len(words):
        raise InputError(
            f"{where}: has the class {index}, but there are {len(words)}: name them in {CLASSES}"
        )
    if len(shares) != 4 and (len(shares) < 6 or len(shares) % 2):
        raise InputError(f"{where}: has {len(shares)} numbers; a box has 4, a polygon 6 or more in pairs")
    # A little beyond the photo is what rounding leaves.
    if not all(math.isfinite(v) and -0.01 <= v <= 1.01 for v in shares):
        raise InputError(f"{where}: has a number outside 0 to 1; numbers are shares of the photo's size")
    low, high = _corners(shares)
    if not (low < high).all():
        raise InputError(f"{where}: has a box without width or height")
    return words[index], shares


def _corners(shares: _Shares) -> tuple[FloatArray, FloatArray]:
    """Low and high corner, (2,) each, in shares of the photo's size."""
    if len(shares) == 4:
        middle, half = np.array(shares[:2]), np.array(shares[2:]) / 2.0
        return middle - half, middle + half
    points = np.array(shares).reshape(-1, 2)
    return points.min(axis=0), points.max(axis=0)


def _objects(lines: Sequence[_Line], photo: Photo) -> list[TrueObject]:
    size, found = np.array([photo.width, photo.height], np.float64), []
    for category, shares in lines:
        low, high = _corners(shares)
        box = Box(*(low * size).tolist(), *(high * size).tolist()).clipped(photo.width, photo.height)
        if box is not None:
            mask = partial(_mask, shares) if len(shares) > 4 else None
            found.append(TrueObject(box, category, box.area, mask=mask))
    return found


def _mask(shares: _Shares, photo: Photo) -> Mask:
    points = np.array(shares).reshape(-1, 2) * [photo.width, photo.height]
    return mask_from_polygons(photo.height, photo.width, [points.ravel().tolist()])
