"""Flat pictures on a surface: number plates, dials, labels and screens."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from cadpose.library.mesh import Material
from cadpose.library.parametric.shapes import box
from cadpose.library.parametric.solids import Paint, Solid

Pixels = NDArray[np.uint8]


def picture_paint(image: Pixels, width: float, name: str, to_front: bool = True) -> Paint:
    """A look that shows ``image`` once, upright, on a face about the origin of ``width`` x ``width`` metres.

    Args:
        image: (N, N, 3) square picture; of an oblong face only its middle is seen.
        width: Metres that the picture covers.
        name: The material's.
        to_front: The face looks to -z; False is for +z.
    """
    # The map's u grows with x, which is the picture's left when seen from the front.
    turned = image[:, ::-1] if to_front else image
    half = len(image) // 2
    # The origin is the picture's middle; the map starts there and repeats.
    rolled = np.roll(turned, (half, half), axis=(0, 1))
    return Paint(Material((1.0, 1.0, 1.0, 1.0), np.ascontiguousarray(rolled), name), width)


def text_picture(
    side: int,
    words: list[tuple[str, float, float, float]],
    paper: tuple[int, int, int],
    ink: tuple[int, int, int],
) -> Pixels:
    """(side, side, 3) words on paper.

    Args:
        side: Pixels.
        words: (text, x, y, height) with the middle of the text and its height in shares of the side.
        paper: Background.
        ink: Colour of the words.
    """
    image = Image.new("RGB", (side, side), paper)
    draw = ImageDraw.Draw(image)
    for text, x, y, height in words:
        font = ImageFont.load_default(size=max(6, height * side))
        draw.text((x * side, y * side), text, fill=ink, font=font, anchor="mm")
    return np.asarray(image, np.uint8)


def random_word(rng: Generator, letters: int, digits: int = 0) -> str:
    """Letters and digits that mean nothing."""
    alphabet = "ABCDEFGHKLMNPRSTUVXYZ"
    word = "".join(alphabet[int(i)] for i in rng.integers(len(alphabet), size=letters))
    return word + "".join(str(int(i)) for i in rng.integers(10, size=digits))


def number_plate(
    rng: Generator, centre: tuple[float, float, float], to_front: bool, width: float = 0.0
) -> tuple[Paint, Solid]:
    """A plate of a made-up number, to be added to a builder; a car's unless a width is given."""
    paper = [(240, 240, 236), (240, 240, 236), (235, 200, 60)][int(rng.integers(3))]
    word = f"{random_word(rng, 2)} {random_word(rng, 0, 3)}{random_word(rng, 1)}"
    image = text_picture(96, [(word, 0.5, 0.5, 0.17)], paper, (25, 25, 30))
    size = (0.50, 0.11, 0.012) if rng.random() < 0.7 else (0.34, 0.15, 0.012)
    if width:
        size = (width, 0.62 * width, 0.012)
    return picture_paint(image, size[0] * 1.05, "number plate", to_front), box(size).moved(*centre)
