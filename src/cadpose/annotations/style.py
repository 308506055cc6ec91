"""How pictures and pages name and colour an object."""

from __future__ import annotations

import io
from collections.abc import Iterable
from functools import lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageFont

from cadpose.geometry.boxes import Box
from cadpose.records import Annotation, Photo, Pose4Dof, Views

Colour = tuple[int, int, int]

#: Of strips and sheets: paper, what a tile lies on, words, lesser words, and a tile's frame or figure.
PAPER: Colour = (255, 255, 255)
TILE_PAPER: Colour = (239, 241, 244)
INK: Colour = (24, 28, 33)
FAINT: Colour = (105, 112, 120)
RIGHT: Colour = (32, 140, 60)
WRONG: Colour = (214, 48, 48)

#: One colour an object, repeated after eight.
COLOURS: tuple[Colour, ...] = (
    (255, 128, 0),
    (0, 158, 255),
    (54, 200, 80),
    (236, 64, 180),
    (250, 204, 21),
    (155, 110, 255),
    (0, 205, 205),
    (244, 70, 70),
)


def colour_of(index: int) -> Colour:
    """The colour of the photo's object number ``index``."""
    return COLOURS[index % len(COLOURS)]


class Flagged(Protocol):
    """What carries a detection's flags: the record, or its part of the document."""

    @property
    def truncated(self) -> bool:
        """The box touches the photo's edge."""
        ...

    @property
    def tiny(self) -> bool:
        """The box has too few pixels."""
        ...

    @property
    def unsure(self) -> bool:
        """The category is a guess."""
        ...


def flags_of(found: Flagged) -> list[str]:
    """Those of ``truncated``, ``tiny`` and ``unsure`` that are set."""
    return [name for name in ("truncated", "tiny", "unsure") if getattr(found, name)]


def category_text(category: str, others: Iterable[str], unsure: bool) -> str:
    """``chair``; of an unsure one ``unsure: chair / sofa / bed``, the three best."""
    if not unsure:
        return category
    return "unsure: " + " / ".join(list(dict.fromkeys([category, *others]))[:3])


@lru_cache(maxsize=32)
def font(size: int) -> Any:
    """Pillow's own TrueType font at ``size`` pixels."""
    return ImageFont.load_default(size)


def short(text: str, limit: int) -> str:
    """Printable characters only, cut to ``limit`` with an ellipsis."""
    clean = "".join(c if c.isprintable() else " " for c in text).strip()
    return clean if len(clean) <= limit else clean[: limit - 1].rstrip() + "…"


def angles_text(pose: Pose4Dof) -> str:
    """``az 312° el 8° ip 0°``."""
    rotation = pose.rotation
    return (
        f"az {round(rotation.azimuth) % 360}° el {round(rotation.elevation)}° ip {round(rotation.inplane)}°"
    )


def standing_text(rank: int, score: float, chance: float | None) -> str:
    """``1 · chance 0.80``; of a candidate whose ranking tells no chance ``1 · score 0.154``."""
    return f"{rank} · score {score:.3f}" if chance is None else f"{rank} · chance {chance:.2f}"


def label_text(annotation: Annotation) -> str:
    """``car · Seat Leon · az 312° el 8° ip 0° · f 842 px``, and the detection's flags."""
    category, name = short(annotation.detection.category, 24), short(annotation.cad.name, 36)
    pose = annotation.pose
    told = [category, name, angles_text(pose), f"f {pose.focal_px:.0f} px", *flags_of(annotation.detection)]
    return " · ".join(told)


def object_crop(photo: Photo, box: Box, side: int, margin: float = 0.06) -> Image.Image:
    """The box with some photo around it, its longer side ``side`` pixels; aspect kept."""
    around = box.scaled(1.0 + 2.0 * margin).clipped(photo.width, photo.height)
    if around is None:
        return Image.new("RGB", (side, side), (128, 128, 128))
    scale = side / max(around.width, around.height)
    size = (max(1, round(around.width * scale)), max(1, round(around.height * scale)))
    return Image.fromarray(photo.rgb).resize(size, Image.Resampling.LANCZOS, box=around.to_tuple())


def view_image(views: Views, index: int, side: int) -> Image.Image:
    """One render with its alpha, longer side at most ``side`` pixels."""
    rgba = np.dstack([views.rgb[index], views.alpha[index]])
    image = Image.fromarray(rgba)
    image.thumbnail((side, side), Image.Resampling.LANCZOS)
    return image


def png_bytes(image: Image.Image) -> bytes:
    """PNG of a picture."""
    out = io.BytesIO()
    image.save(out, "PNG")
    return out.getvalue()


def jpeg_bytes(image: Image.Image, quality: int = 85) -> bytes:
    """JPEG of an opaque picture."""
    out = io.BytesIO()
    image.convert("RGB").save(out, "JPEG", quality=quality, optimize=True)
    return out.getvalue()


def resized(array: NDArray[np.uint8], width: int, height: int) -> NDArray[np.uint8]:
    """(H, W[, C]) uint8 at another size: averaged when shrinking, cubic when growing."""
    import cv2

    if array.shape[:2] == (height, width):
        return array
    shrinks = array.shape[0] > height
    return np.asarray(
        cv2.resize(array, (width, height), interpolation=cv2.INTER_AREA if shrinks else cv2.INTER_CUBIC),
        np.uint8,
    )
