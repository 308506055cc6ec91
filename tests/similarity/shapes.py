"""Made-up views: five drawn figures that fill a square as framed renders do."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.records import Views

Image = NDArray[np.uint8]


def figure(kind: int, size: int = 224) -> tuple[Image, Image]:
    """RGB and alpha of figure 0 to 4: hulls as wide as the square with parts that differ."""
    rgb = np.zeros((size, size, 3), np.uint8)
    alpha = np.zeros((size, size), np.uint8)
    s = size / 224.0

    def part(draw_on: list[tuple[int, int]], colour: tuple[int, int, int]) -> None:
        points = [np.array([(round(x * s), round(y * s)) for x, y in draw_on], np.int32)]
        cv2.fillPoly(rgb, points, colour)
        cv2.fillPoly(alpha, points, (255,))

    def wheel(x: int, y: int, r: int) -> None:
        for image, colour in ((rgb, (25, 25, 25)), (alpha, (255,))):
            cv2.circle(image, (round(x * s), round(y * s)), round(r * s), colour, -1)
        cv2.circle(rgb, (round(x * s), round(y * s)), round(r * s / 2), (190, 190, 190), -1)

    part([(0, 110), (223, 110), (223, 165), (0, 165)], (180, 40, 40))
    cabin = [
        [(40, 110), (80, 60), (160, 60), (200, 110)],
        [(0, 110), (0, 50), (120, 50), (120, 110)],
        [(60, 110), (60, 20), (223, 20), (223, 110)],
        [(90, 110), (110, 90), (140, 90), (150, 110)],
        [(20, 110), (112, 30), (200, 110)],
    ][kind]
    part(cabin, (60, 60, 160))
    middle = np.mean(cabin, axis=0)
    window = [(round(0.6 * x + 0.4 * middle[0]), round(0.6 * y + 0.4 * middle[1])) for x, y in cabin]
    part(window, (170, 210, 230))
    for x in ((45, 175), (30, 190), (60, 160), (40, 185), (80, 150))[kind]:
        wheel(x, 168, 22 + 2 * kind)
    return rgb, alpha


def five_views(size: int = 224) -> Views:
    drawn = [figure(k, size) for k in range(5)]
    alpha = np.stack([a for _, a in drawn])
    return Views(
        rgb=np.stack([c for c, _ in drawn]),
        alpha=alpha,
        depth=np.where(alpha > 0, 2.0, np.inf).astype(np.float32),
    )


def photo_of(kind: int, size: int = 224, seed: int = 0) -> Image:
    """The figure before a gradient, darker, noisy and slightly shifted."""
    rgb, alpha = figure(kind, size)
    ramp = np.linspace(90, 200, size)[:, None, None] * np.array([0.8, 1.0, 0.9])
    picture = np.where(alpha[..., None] > 0, rgb * 0.8 + 20, ramp)
    picture = np.roll(picture, (2, -3), axis=(0, 1))
    picture += np.random.default_rng(seed).normal(0, 6, picture.shape)
    return np.clip(picture, 0, 255).astype(np.uint8)
