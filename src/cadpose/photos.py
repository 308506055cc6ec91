"""Photographs: finding the files, decoding them safely, and cutting square crops out of them."""

from __future__ import annotations

import glob
import hashlib
import io
import logging
import re
import stat
import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import cast, overload

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps

from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Mask, Photo

log = logging.getLogger(__name__)

#: Largest photo file that is read.
MAX_BYTES = 64 * 2**20
#: Largest photo that is decoded; told from the header, before a pixel is unpacked.
MAX_PIXELS = 50_000_000
#: Decoders an untrusted file may reach. Pillow knows many more, some of which start other programs.
FORMATS = ("JPEG", "MPO", "PNG", "WEBP", "TIFF", "BMP", "GIF", "PPM", "JPEG2000", "AVIF")
_SUFFIXES = {
    "jpg",
    "jpeg",
    "jpe",
    "jfif",
    "png",
    "webp",
    "tif",
    "tiff",
    "bmp",
    "gif",
    "ppm",
    "pgm",
    "pnm",
    "jp2",
    "avif",
}
#: Endings that count as a photo in a folder or behind a wildcard.
SUFFIXES = frozenset(f".{s}" for s in _SUFFIXES)
#: Grey level beside the object in a crop; the templates are rendered on the same.
FILL = 255


def read_photo(path: Path | str) -> Photo:
    """Decode a photo: EXIF orientation applied, first frame, 8-bit RGB, transparency over white.

    Raises:
        InputError: the file is not there, too large, damaged, or not a photo.
    """
    path = Path(path)
    data = _read_capped(path)
    name = str(path)
    try:
        with warnings.catch_warnings():
            # Between Pillow's warning and its error lies our own limit, checked below.
            warnings.simplefilter("ignore")
            image = Image.open(io.BytesIO(data), formats=_known_formats())
    except Image.DecompressionBombError:
        raise InputError(_too_many_pixels(name, "more than 170")) from None
    except Exception:  # Pillow's readers of headers raise anything at all on hostile bytes
        raise InputError(
            f"{name} is not a photo that can be read: save it as JPEG, PNG, WebP or TIFF."
        ) from None
    if image.width * image.height > MAX_PIXELS:
        raise InputError(_too_many_pixels(name, f"{image.width * image.height / 1e6:.0f}"))
    try:
        if getattr(image, "is_animated", False) and image.format != "MPO":
            log.warning("%s holds several frames; only the first one is used", name)
        focal = _focal_35mm(image)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image.load()
            rgb = _to_rgb8(_upright(image))
    except MemoryError:
        raise InputError(
            f"{name} needs more memory than this machine has to give: make it smaller."
        ) from None
    except Exception as error:  # Pillow's decoders raise anything at all on hostile bytes
        raise InputError(f"{name} is damaged or cut short ({_reason(error)}): get a whole copy.") from None
    return Photo(rgb=rgb, name=name, sha256=hashlib.sha256(data).hexdigest(), focal_35mm=focal)


def find_photos(args: Sequence[str | Path], *, recursive: bool = False) -> list[Path]:
    """The photos that PHOTO, DIR and GLOB arguments stand for, each once.

    A folder gives its image files in natural order (``img2`` before ``img10``), hidden files left out;
    a wildcard gives the image files it matches (``**`` reaches into folders). Any existing file that is
    named outright is taken as it is.

    Args:
        args: Files, folders and wildcards.
        recursive: Whether folders are searched to the bottom.

    Raises:
        InputError: an argument stands for no photo.
    """
    found: dict[Path, Path] = {}
    for arg in args:
        path = Path(arg).expanduser()
        if path.is_dir():
            inside = path.rglob("*") if recursive else path.glob("*")
            matches = _images(p for p in inside if not _hidden(p.relative_to(path)))
            if not matches:
                raise InputError(f"the folder {arg} holds no photo: name one that holds JPEG or PNG files.")
        elif path.exists():
            matches = [path]
        elif glob.has_magic(str(path)):
            pattern = str(path)  # Path.glob refuses absolute patterns
            matches = _images(Path(p) for p in glob.iglob(pattern, recursive=True))  # noqa: PTH207
            if not matches:
                raise InputError(f"no photo matches {arg}: check the spelling of the pattern.")
        else:
            raise InputError(f"there is no file or folder {arg}: check the spelling of the path.")
        for match in matches:
            found.setdefault(match.resolve(), match)
    if not found:
        raise InputError("no photo was named: give a photo, a folder or a pattern such as 'photos/*.jpg'.")
    return list(found.values())


@overload
def crop_square(
    image: NDArray[np.uint8], box: Box, size: int = ..., fill: int = ..., *, context: bool = ...
) -> NDArray[np.uint8]: ...


@overload
def crop_square(image: Mask, box: Box, size: int = ..., fill: int = ..., *, context: bool = ...) -> Mask: ...


def crop_square(
    image: NDArray[np.uint8] | Mask,
    box: Box,
    size: int = 224,
    fill: int = FILL,
    *,
    context: bool = False,
) -> NDArray[np.uint8] | Mask:
    """The box, letterboxed into a square: its longer side fills the square, its middle is the middle.

    Exact to the sub-pixel and matched to :meth:`cadpose.geometry.camera.Cameras.framing`: a photo point
    p lands at ``size / 2 + (p - box.centre) * size / max(box.width, box.height)``. Shrinking averages
    over the pixels that fall together, growing interpolates (Pillow's cubic; linear for masks).

    Args:
        image: (H, W, 3) uint8, or a (H, W) bool mask.
        box: Rectangle in continuous pixels; it may reach outside the photo.
        size: Side of the square in pixels.
        fill: Grey level beside the box and outside the photo (masks: always False).
        context: Show the photo instead of ``fill`` beside the box.

    Returns:
        (size, size, 3) uint8, or (size, size) bool, True where the mask covers half of the pixel.

    Raises:
        ValueError: the box does not meet the photo, or is more than 16 times its size.
    """
    height, width = image.shape[:2]
    side = max(box.width, box.height)
    if side > 16 * max(width, height):
        raise ValueError(f"{box} is far larger than the photo of {width} x {height} pixels")
    (cx, cy), half = box.centre, side / 2.0
    shown = (Box(cx - half, cy - half, cx + half, cy + half) if context else box).clipped(width, height)
    if shown is None:
        raise ValueError(f"{box} lies outside the photo of {width} x {height} pixels")
    step = side / size
    corner = np.array([cx - half, cy - half])  # photo position of the square's corner
    low = np.subtract((shown.x0, shown.y0), corner) / step
    high = np.subtract((shown.x1, shown.y1), corner) / step

    # Output pixels that see anything, and the photo window under them.
    first = np.clip(np.floor(low + 1e-9).astype(int), 0, size - 1)
    last = np.clip(np.ceil(high - 1e-9).astype(int), first + 1, size)
    start, stop = corner + first * step, corner + last * step

    # The filter reads two steps beyond the window; past the photo's border the border goes on.
    reach = 2.0 * max(step, 1.0) + 1.0
    a = np.floor(start - reach).astype(int)
    b = np.ceil(stop + reach).astype(int)
    inner = image[max(a[1], 0) : max(b[1], 1), max(a[0], 0) : max(b[0], 1)]
    pad = [(max(-a[1], 0), max(b[1] - height, 0)), (max(-a[0], 0), max(b[0] - width, 0))]
    is_mask = image.dtype == np.bool_
    source = np.where(inner, np.uint8(255), np.uint8(0)) if is_mask else inner
    source = np.pad(source, pad + [(0, 0)] * (image.ndim - 2), mode="edge")
    cut = Image.fromarray(source).resize(
        (int(last[0] - first[0]), int(last[1] - first[1])),
        Image.Resampling.BILINEAR if is_mask else Image.Resampling.BICUBIC,
        box=(*(start - a).tolist(), *(stop - a).tolist()),
    )

    # Share of each output pixel that the shown rectangle covers, exact along its borders.
    edge = np.arange(size)
    across, down = (
        np.clip(np.minimum(edge + 1, high[i]) - np.maximum(edge, low[i]), 0.0, 1.0) for i in (0, 1)
    )
    cover = np.outer(down, across)
    background = 0 if is_mask else fill
    out = np.full((size, size, *image.shape[2:]), float(background))
    out[first[1] : last[1], first[0] : last[0]] = np.asarray(cut)
    cover = cover.reshape(size, size, *[1] * (image.ndim - 2))
    out = background + (out - background) * cover
    return np.asarray(out >= 127.5) if is_mask else np.rint(out).astype(np.uint8)


def _read_capped(path: Path) -> bytes:
    """The file's bytes; InputError when missing, special, empty or over the limit."""
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode):
            raise InputError(f"{path} is not a file: name a photo.")
        if status.st_size > MAX_BYTES:
            raise InputError(
                f"{path} has {status.st_size / 2**20:.0f} MB, more than the limit of "
                f"{MAX_BYTES // 2**20} MB: save it smaller."
            )
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError(f"there is no file {path}: check the spelling of the path.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be opened ({_reason(error)}): check its permissions.") from None
    if not data:
        raise InputError(f"{path} is empty (0 bytes): get a whole copy.")
    if len(data) > MAX_BYTES:
        raise InputError(f"{path} grew past the limit of {MAX_BYTES // 2**20} MB: save it smaller.")
    return data


def _known_formats() -> list[str]:
    """Those of FORMATS that this build of Pillow has."""
    Image.init()
    return [f for f in FORMATS if f in Image.OPEN]


def _too_many_pixels(name: str, megapixels: str) -> str:
    return f"{name} has {megapixels} megapixels, more than the limit of {MAX_PIXELS // 10**6}: scale it down."


def _reason(error: BaseException) -> str:
    """First line of an error, short enough for a sentence."""
    text = getattr(error, "strerror", None) or str(error) or type(error).__name__
    return str(text).splitlines()[0][:120]


def _focal_35mm(image: Image.Image) -> float | None:
    """EXIF's 35 mm equivalent focal length where it is there and believable."""
    try:
        value = image.getexif().get_ifd(ExifTags.IFD.Exif).get(ExifTags.Base.FocalLengthIn35mmFilm)
        focal = float(value) if value is not None else 0.0
    except Exception:  # a broken EXIF block is no reason to refuse the photo
        return None
    return focal if 1.0 <= focal <= 5000.0 else None


def _upright(image: Image.Image) -> Image.Image:
    """EXIF orientation applied; a broken EXIF block counts as none."""
    try:
        image.getexif()
    except Exception:  # as above: the photo is used as it lies in the file
        return image
    return ImageOps.exif_transpose(image)


def _to_rgb8(image: Image.Image) -> NDArray[np.uint8]:
    """Any Pillow mode to (H, W, 3) uint8, transparency over white."""
    if image.mode in ("I", "F") or image.mode.startswith("I;16"):
        return np.repeat(_deep_grey(image)[..., None], 3, axis=2)
    if image.mode in ("RGBA", "LA", "PA", "RGBa", "La") or "transparency" in image.info:
        rgba = np.asarray(image.convert("RGBA")).astype(np.uint16)
        alpha = rgba[..., 3:]
        return ((rgba[..., :3] * alpha + 255 * (255 - alpha) + 127) // 255).astype(np.uint8)
    return np.array(image.convert("RGB"))


def _deep_grey(image: Image.Image) -> NDArray[np.uint8]:
    """(H, W) grey of 16 bits, 32 bits or floats to 8 bits; floats up to 1 are shares, others levels."""
    levels = np.asarray(image).astype(np.float64)
    if not np.isfinite(levels).all():
        raise ValueError("pixels that are not numbers")
    in_shares = image.mode == "F" and levels.max() <= 1.0
    scale = 255.0 if in_shares else 1.0 if image.mode == "F" else 255.0 / 65535.0
    return np.clip(np.rint(levels * scale), 0, 255).astype(np.uint8)


def _images(paths: Iterable[Path]) -> list[Path]:
    return sorted((p for p in paths if p.suffix.lower() in SUFFIXES and p.is_file()), key=_natural)


def _hidden(relative: Path) -> bool:
    return any(part.startswith(".") for part in relative.parts)


def _natural(path: Path) -> tuple[tuple[tuple[int, int, str], ...], ...]:
    """Sort key: numbers in names by value, letters without regard to case."""
    return tuple(
        tuple(
            (0, int(piece), "") if piece.isdecimal() else (1, 0, piece.casefold())
            for piece in cast("list[str]", re.split(r"(\d+)", part))
            if piece
        )
        for part in path.parts
    )
