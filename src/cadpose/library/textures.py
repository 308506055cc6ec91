"""Texture images: judged by their header, decoded, reduced, and encoded again for the store."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.errors import InputError
from cadpose.library.limits import DEFAULT_LIMITS, Limits

# Formats that Pillow decodes by itself; EPS, for one, would start a program.
_FORMATS = ("PNG", "JPEG", "BMP", "TGA", "GIF", "WEBP", "TIFF", "DDS", "PPM")
_EXTRA_BITS = {"I", "I;16", "I;16B", "I;16L", "F"}


@dataclass
class TextureBudget:
    """What one model's textures have used up so far."""

    limits: Limits = DEFAULT_LIMITS
    pixels: int = field(default=0, init=False)
    count: int = field(default=0, init=False)

    def decode(self, data: bytes, name: str) -> NDArray[np.uint8]:
        """(H, W, 3) or (H, W, 4) uint8 sRGB, at most ``limits.texture_side`` a side.

        Raises:
            InputError: it is no image, is damaged, or goes over a limit.
        """
        limits = self.limits
        self.count += 1
        if self.count > limits.textures:
            raise InputError(f"the model has more than the {limits.textures} textures allowed.")
        if len(data) > limits.texture_bytes:
            raise InputError(f"texture {name} is larger than the {limits.texture_bytes >> 20} MiB allowed.")
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                image = Image.open(io.BytesIO(data), formats=_FORMATS)
                self._spend(image.width, image.height, name)
                image.draft("RGB", (limits.texture_side, limits.texture_side))
                return _to_array(image, limits.texture_side)
        except InputError:
            raise
        except Exception as error:  # Pillow's decoders raise whatever their parser met
            raise InputError(f"texture {name} cannot be decoded ({error}).") from error

    def charge(self, texture: NDArray[np.uint8], name: str) -> None:
        """Count the pixels of a further copy that is to be made of a decoded texture.

        Raises:
            InputError: it goes over a limit.
        """
        self._spend(texture.shape[1], texture.shape[0], name)

    def _spend(self, width: int, height: int, name: str) -> None:
        pixels = width * height
        if pixels > self.limits.texture_pixels or self.pixels + pixels > self.limits.total_pixels:
            raise InputError(f"texture {name} has {width} x {height} pixels, more than is allowed.")
        self.pixels += pixels


def _to_array(image: Image.Image, side: int) -> NDArray[np.uint8]:
    if image.mode in _EXTRA_BITS:
        values = np.asarray(image, dtype=np.float64)
        scale = 255.0 / 65535.0 if image.mode != "F" or values.max() > 1 else 255.0
        image = Image.fromarray(np.clip(values * scale, 0, 255).astype(np.uint8), "L")
    has_alpha = "A" in image.getbands() or "transparency" in image.info
    image = image.convert("RGBA" if has_alpha else "RGB")
    if max(image.size) > side:
        factor = side / max(image.size)
        size = (max(1, round(image.width * factor)), max(1, round(image.height * factor)))
        image = image.resize(size, Image.Resampling.BOX if factor < 0.5 else Image.Resampling.BILINEAR)
    array = np.array(image, dtype=np.uint8)
    if has_alpha and (array[..., 3] == 255).all():
        array = np.ascontiguousarray(array[..., :3])
    return array


def with_alpha_map(texture: NDArray[np.uint8], alpha_map: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """A texture whose alpha comes from another image (its own alpha, else its brightness)."""
    height, width = texture.shape[:2]
    if alpha_map.shape[2] == 4:
        source = Image.fromarray(np.ascontiguousarray(alpha_map[..., 3]))
    else:
        source = Image.fromarray(alpha_map).convert("L")
    alpha = np.asarray(source.resize((width, height), Image.Resampling.BILINEAR))
    return np.dstack([texture[..., :3], alpha])


def mean_colour(texture: NDArray[np.uint8]) -> tuple[float, float, float, float]:
    """A texture's mean colour in [0, 1], weighted by its alpha."""
    pixels = texture.reshape(-1, texture.shape[2]).astype(np.float64) / 255.0
    if texture.shape[2] == 3:
        r, g, b = pixels.mean(axis=0)
        return float(r), float(g), float(b), 1.0
    weight = pixels[:, 3]
    total = float(weight.sum())
    if total <= 0:
        return 0.7, 0.7, 0.7, 1.0
    r, g, b = (pixels[:, :3] * weight[:, None]).sum(axis=0) / total
    return float(r), float(g), float(b), float(weight.mean())


def encode_texture(texture: NDArray[np.uint8]) -> bytes:
    """JPEG for an opaque photo-like texture, PNG where alpha or few pixels make it the better choice."""
    out = io.BytesIO()
    if texture.shape[2] == 3 and texture.shape[0] * texture.shape[1] > 4096:
        Image.fromarray(texture).save(out, "JPEG", quality=92, subsampling=0)
    else:
        Image.fromarray(texture).save(out, "PNG", compress_level=4)
    return out.getvalue()


def decode_stored(data: bytes) -> NDArray[np.uint8]:
    """What `encode_texture` wrote."""
    with Image.open(io.BytesIO(data), formats=("PNG", "JPEG")) as image:
        return np.array(image)
