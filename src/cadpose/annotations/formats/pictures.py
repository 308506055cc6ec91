"""Photos and masks as PNG files beside an export."""

from __future__ import annotations

import io
import os
import warnings
from pathlib import Path

import numpy as np
from PIL import ExifTags, Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import file_stem
from cadpose.errors import InputError
from cadpose.records import Mask, Photo
from cadpose.rle import MAX_PIXELS

#: Largest mask file that is read.
MAX_BYTES = 64 * 2**20


def write_png(path: Path, pixels: Mask | Photo) -> None:
    """A photo in colour, or a mask as 0 and 255; folders are made."""
    path.parent.mkdir(parents=True, exist_ok=True)
    array = pixels.rgb if isinstance(pixels, Photo) else pixels.astype(np.uint8) * np.uint8(255)
    Image.fromarray(array).save(path, "PNG", compress_level=1)


def same_file(path: Path, first: Path) -> None:
    """The picture ``first`` under a second name; disk space is shared where the file system can."""
    try:
        os.link(first, path)
    except OSError:
        path.write_bytes(first.read_bytes())


def read_mask(path: Path, size: tuple[int, int]) -> Mask:
    """A mask that counts where it is 128 or brighter.

    Args:
        path: PNG file.
        size: (height, width) that it must have.

    Returns:
        (height, width) bool.

    Raises:
        InputError: it cannot be read or has another size; told before a pixel is unpacked.
    """
    try:
        if path.stat().st_size > MAX_BYTES or size[0] * size[1] > MAX_PIXELS:
            raise InputError(f"{path} is larger than masks may be: make it smaller")
        data = path.read_bytes()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the size is checked below
            image = Image.open(io.BytesIO(data), formats=("PNG",))
        if image.size != (size[1], size[0]):
            told = f"{image.width} x {image.height} pixels and not {size[1]} x {size[0]}"
            raise InputError(f"{path} has {told}: make the mask on the picture that it belongs to")
        return np.asarray(np.asarray(image.convert("L")) >= 128)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or 'no PNG'}): export again") from None
    except Exception:  # Pillow's readers raise anything at all on hostile bytes
        raise InputError(f"{path} is not a PNG that can be read: export again") from None


def copy_photo(sources: Sources, document: AnnotationDocument, folder: Path) -> Path:
    """The photo's file in ``folder``: its own bytes where browsers show them upright, else a PNG of them.

    Raises:
        InputError: the photo is not there, or is another one.
    """
    photo = sources.photo(document)
    data = sources.photo_path(document).read_bytes()
    image = Image.open(io.BytesIO(data))
    upright = image.getexif().get(ExifTags.Base.Orientation, 1) == 1
    ending = {"JPEG": ".jpg", "PNG": ".png", "WEBP": ".webp"}.get(image.format or "")
    if ending and upright and image.size == (photo.width, photo.height):
        path = folder / f"{file_stem(document)}{ending}"
        path.write_bytes(data)
        return path
    path = folder / f"{file_stem(document)}.png"
    write_png(path, photo)
    return path
