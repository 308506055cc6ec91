"""Backdrops and textures: crops of a folder of photos, or made up where there are none."""

from __future__ import annotations

import logging
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.errors import CadposeError, InputError
from cadpose.photos import find_photos, read_photo

log = logging.getLogger(__name__)

Picture = NDArray[np.uint8]
#: Photos are kept in memory no larger than this.
_KEPT_SIDE = 400


class Backdrops:
    """Draws backdrops.

    Args:
        folder: Photos to cut backdrops from; None for made-up ones only.

    Raises:
        InputError: the folder holds no photo that can be read.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self.photos: list[Picture] = []
        if folder is None:
            return
        for path in find_photos([folder]):
            try:
                self.photos.append(_reduced(np.array(read_photo(path).rgb)))
            except CadposeError as error:
                log.warning("%s is left out: %s", path, error)
        if not self.photos:
            raise InputError(f"{folder} holds no photo to use as a backdrop.")

    def draw(self, rng: np.random.Generator, size: int, photo_chance: float = 0.6) -> Picture:
        """A (size, size, 3) backdrop."""
        if self.photos and rng.random() < photo_chance:
            return self._cut(rng, size)
        kind = rng.choice(4, p=(0.25, 0.25, 0.3, 0.2))
        if kind == 0:
            return _plain(rng, size)
        if kind == 1:
            return _gradient(rng, size)
        if kind == 2:
            return self._room(rng, size)
        return _clouds(rng, size)

    def texture(self, rng: np.random.Generator, side: int = 64) -> Picture:
        """A (side, side, 3) texture: a patch of a photo, stripes, checks or clouds."""
        kind = rng.random()
        if self.photos and kind < 0.4:
            return self._cut(rng, side, rng.uniform(0.1, 0.5))
        if kind < 0.7:
            a, b = _colour(rng), _colour(rng)
            t = np.arange(side) / side * 2 * np.pi * rng.integers(1, 9)
            wave = np.sin(t)[None, :] * np.ones((side, 1))
            if rng.random() < 0.4:
                wave = wave * wave.T
            share = np.clip(0.5 + wave * rng.uniform(0.6, 4.0), 0, 1)[..., None]
            if rng.random() < 0.5:
                share = share.transpose(1, 0, 2)
            return np.rint(a * share + b * (1 - share)).astype(np.uint8)
        return _clouds(rng, side)

    def _cut(self, rng: np.random.Generator, size: int, share: float | None = None) -> Picture:
        photo = self.photos[rng.integers(len(self.photos))]
        least = min(photo.shape[:2])
        wanted = int(least * (share if share is not None else rng.uniform(0.5, 1.0)))
        side = min(max(8, wanted), least)
        row = int(rng.integers(photo.shape[0] - side + 1))
        column = int(rng.integers(photo.shape[1] - side + 1))
        cut = photo[row : row + side, column : column + side]
        if rng.random() < 0.5:
            cut = cut[:, ::-1]
        return np.asarray(cv2.resize(cut, (size, size), interpolation=cv2.INTER_LINEAR), np.uint8)

    def _room(self, rng: np.random.Generator, size: int) -> Picture:
        """A floor and a wall with a level line between them."""
        wall, floor = (
            self._cut(rng, size, rng.uniform(0.1, 0.4))
            if self.photos and rng.random() < 0.35
            else _gradient(rng, size)
            for _ in range(2)
        )
        line = int(size * rng.uniform(0.15, 0.85))
        out = wall.copy()
        out[line:] = floor[line:]
        if rng.random() < 0.5 and line + 4 < size:
            out[line : line + int(rng.integers(1, 5))] = _colour(rng).astype(np.uint8)
        return out


def _reduced(photo: Picture) -> Picture:
    scale = _KEPT_SIDE / max(photo.shape[:2])
    if scale >= 1.0:
        return photo
    height, width = (max(1, round(n * scale)) for n in photo.shape[:2])
    return np.asarray(cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA), np.uint8)


def _colour(rng: np.random.Generator) -> NDArray[np.float64]:
    """(3,) in [0, 255], more often pale and grey than not."""
    if rng.random() < 0.4:
        return np.full(3, rng.choice([255.0, 250.0, 240.0, 225.0, 190.0, 128.0])) - rng.uniform(0, 6, 3)
    value, spread = rng.uniform(20, 255), rng.uniform(0.0, 0.6)
    return np.asarray(value * (1.0 - spread * rng.random(3)))


def _plain(rng: np.random.Generator, size: int) -> Picture:
    return np.broadcast_to(_colour(rng).astype(np.uint8), (size, size, 3)).copy()


def _gradient(rng: np.random.Generator, size: int) -> Picture:
    a, b = _colour(rng), _colour(rng)
    angle = rng.uniform(0, 2 * np.pi)
    t = np.linspace(-0.5, 0.5, 16)
    share = np.clip(0.5 + np.cos(angle) * t[None, :] + np.sin(angle) * t[:, None], 0, 1)[..., None]
    small = np.clip(a + (b - a) * share * rng.uniform(0.1, 0.6), 0, 255).astype(np.float32)
    return np.asarray(cv2.resize(small, (size, size), interpolation=cv2.INTER_LINEAR)).astype(np.uint8)


def _clouds(rng: np.random.Generator, size: int) -> Picture:
    """Coloured noise of several scales."""
    base = _colour(rng)
    out = np.broadcast_to(base, (size, size, 3)).astype(np.float32)
    for cells in (3, 7, 17, 41):
        noise = rng.normal(0.0, rng.uniform(4, 30), (cells, cells, 3 if rng.random() < 0.4 else 1))
        if noise.shape[2] == 1:
            noise = np.repeat(noise, 3, axis=2)
        out = out + cv2.resize(noise.astype(np.float32), (size, size), interpolation=cv2.INTER_CUBIC)
    return np.clip(out, 0, 255).astype(np.uint8)
