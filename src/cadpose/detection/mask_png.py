"""Masks from PNG files: one object, or many told apart by the pixels' values."""

from __future__ import annotations

import io
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.detection.reading import check_room, read_capped
from cadpose.errors import InputError
from cadpose.records import Mask, Photo

#: Largest mask file that is read.
MAX_BYTES = 64 * 2**20
#: Most objects of one file.
MAX_OBJECTS = 100
#: Border between objects in the palette masks of Pascal VOC: no object.
VOID = 255
#: Grey masks with white and more values than this have soft edges, not objects.
_SOFT = 16


def read_masks(path: Path, photo: Photo, before: int = 0) -> list[Mask]:
    """The objects of a mask file.

    0 is the background. Where there is one other value, all of its pixels are one object; where there are
    more, each value is an object of its own. Of palette images the indices count, not the colours.

    Args:
        path: PNG of the photo's size: grey of 1, 8 or 16 bits, palette, or colour with equal channels.
        photo: The photo it belongs to.
        before: How many masks of the photo are held already.

    Returns:
        One (H, W) bool mask an object, by rising value; none where all is background.

    Raises:
        InputError: it cannot be read, is no PNG of the photo's size, is in colour, is transparent, or has
            too many values, or the photo gets too many masks.
    """
    values, palette = _values(path, photo)
    present = np.zeros(1 << 16, np.bool_)
    present[values] = True
    found = [int(v) for v in np.flatnonzero(present) if v]
    if palette and len(found) > 1:
        found = [v for v in found if v != VOID]
    soft = not palette and values.dtype == np.uint8 and found[-1:] == [255] and len(found) > _SOFT
    if soft or len(found) > MAX_OBJECTS:
        raise InputError(
            f"{path} has {len(found)} values beside 0, too many for objects: save a mask without soft edges, "
            f"0 and 255, or number its objects 1, 2, 3 ..."
        )
    check_room(path, len(found), photo, before)
    return [np.asarray(values == v) for v in found]


def _values(path: Path, photo: Photo) -> tuple[NDArray[np.uint8] | NDArray[np.uint16], bool]:
    """(H, W) pixel values, and whether they are a palette's indices."""
    data = read_capped(path, MAX_BYTES, "a PNG mask")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked below
            image = Image.open(io.BytesIO(data), formats=("PNG",))
    except Image.DecompressionBombError:
        raise InputError(f"{path} has far more pixels than {photo.name}: make it as large.") from None
    except Exception:  # Pillow's readers of headers raise anything at all on hostile bytes
        raise InputError(f"{path} is not a PNG that can be read: save the mask as PNG.") from None
    if image.size != (photo.width, photo.height):
        raise InputError(
            f"{path} has {image.width} x {image.height} pixels but {photo.name} has "
            f"{photo.width} x {photo.height} upright: make the mask on the photo as it is seen."
        )
    try:
        image.load()
    except Exception:  # as above, of the pixels
        raise InputError(f"{path} is damaged or cut short: get a whole copy.") from None
    pixels = np.asarray(image)
    if image.mode == "P":
        return pixels.astype(np.uint8), True
    if image.mode in ("LA", "RGBA"):
        if (pixels[..., -1] < 255).any():
            raise InputError(f"{path} is transparent: save the mask as grey, 0 beside the object.")
        pixels = pixels[..., :-1]
    if pixels.ndim == 3:
        if (pixels != pixels[..., :1]).any():
            raise InputError(f"{path} is in colour: save the mask as grey or with a palette.")
        pixels = pixels[..., 0]
    if pixels.dtype == np.bool_ or pixels.dtype == np.uint8:
        return pixels.astype(np.uint8), False
    return pixels.clip(0, 2**16 - 1).astype(np.uint16), False
