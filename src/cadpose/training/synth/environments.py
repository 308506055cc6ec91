"""Light from all around, for Blender: a folder of HDR panoramas, or made up: skies, rooms, studios."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.rendering.blender_photo import SUFFIXES, check_environment

_HEIGHT, _WIDTH = 128, 256

FloatPicture = NDArray[np.float32]


def hdri_files(folder: Path) -> list[Path]:
    """The panoramas of a folder, by name.

    Raises:
        InputError: there is no such folder, none is in it, or one is too large.
    """
    if not folder.is_dir():
        raise InputError(f"there is no folder {folder}: name one with .hdr or .exr panoramas")
    found = sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file())
    if not found:
        raise InputError(f"the folder {folder} holds no .hdr or .exr panorama to light with")
    for path in found:
        check_environment(path)
    return found


def made_up(rng: np.random.Generator) -> FloatPicture:
    """(128, 256, 3) linear light, latitude by longitude, straight up in the first row."""
    kind = rng.choice(3, p=(0.4, 0.35, 0.25))
    if kind == 0:
        return _sky(rng)
    return _room(rng) if kind == 1 else _studio(rng)


def _directions() -> NDArray[np.float64]:
    """(128, 256, 3) unit vectors, the third towards the zenith."""
    latitude = np.pi * (0.5 - (np.arange(_HEIGHT) + 0.5) / _HEIGHT)[:, None]
    longitude = 2 * np.pi * (np.arange(_WIDTH) + 0.5)[None, :] / _WIDTH
    return np.stack(
        [
            np.cos(latitude) * np.cos(longitude),
            np.cos(latitude) * np.sin(longitude),
            np.broadcast_to(np.sin(latitude), (_HEIGHT, _WIDTH)),
        ],
        axis=-1,
    )


def _sky(rng: np.random.Generator) -> FloatPicture:
    """A sky from white at the horizon to blue or grey, with or without a sun, over a dull ground."""
    towards = _directions()
    up = towards[..., 2:]
    grey = rng.random() < 0.4
    zenith = np.array([0.5, 0.52, 0.55] if grey else [0.18, 0.35, 0.8])
    horizon = np.array([0.75, 0.77, 0.8])
    light = horizon + (zenith - horizon) * np.clip(up, 0, 1) ** 0.5
    ground = rng.uniform(0.05, 0.35) * np.array([1.0, 0.95, 0.85])
    light = np.where(up < 0, ground, light)
    if not grey or rng.random() < 0.3:
        light = light + _lamp(rng, towards, (8.0, 70.0), (1.5, 9.0), (4.0, 40.0), warm=0.25)
    return light.astype(np.float32)


def _room(rng: np.random.Generator) -> FloatPicture:
    """Pale walls, a darker floor, a ceiling lamp or two and one to three windows."""
    towards = _directions()
    up = towards[..., 2:]
    wall = rng.uniform(0.1, 0.35) * np.array([1.0, 0.96, 0.9])
    light = np.where(up < -0.3, wall * rng.uniform(0.3, 0.8), np.where(up > 0.75, wall * 1.4, wall))
    for _ in range(int(rng.integers(1, 4))):
        light = _panel(rng, light, (-15.0, 50.0), (2.0, 14.0), np.array([0.9, 0.97, 1.05]))
    for _ in range(int(rng.integers(0, 3))):
        light = light + _lamp(rng, towards, (50.0, 88.0), (3.0, 10.0), (2.0, 14.0), warm=0.4)
    return light.astype(np.float32)


def _studio(rng: np.random.Generator) -> FloatPicture:
    """An even surround and a few soft boxes."""
    light = np.full((_HEIGHT, _WIDTH, 3), rng.uniform(0.15, 0.8))
    for _ in range(int(rng.integers(1, 4))):
        light = _panel(rng, light, (10.0, 80.0), (2.0, 12.0), np.ones(3))
    return light.astype(np.float32)


def _lamp(
    rng: np.random.Generator,
    towards: NDArray[np.float64],
    height: tuple[float, float],
    width: tuple[float, float],
    share: tuple[float, float],
    warm: float,
) -> NDArray[np.float64]:
    """A round light: height and width in degrees, ``share`` of the surround's light that it gives."""
    at, turn = np.deg2rad(rng.uniform(*height)), rng.uniform(0, 2 * np.pi)
    middle = np.array([np.cos(at) * np.cos(turn), np.cos(at) * np.sin(turn), np.sin(at)])
    sigma = np.deg2rad(rng.uniform(*width))
    spot = np.exp((towards @ middle - 1.0) / sigma**2)[..., None]
    colour = np.array([1.0, 1.0 - 0.4 * warm * rng.random(), 1.0 - warm * rng.random()])
    # The solid angle of the spot is 2·pi·sigma², that of the sphere 4·pi.
    return np.asarray(spot * colour * rng.uniform(*share) * 0.1 / (2.0 * sigma**2))


def _panel(
    rng: np.random.Generator,
    light: NDArray[np.float64],
    height: tuple[float, float],
    strength: tuple[float, float],
    colour: NDArray[np.float64],
) -> NDArray[np.float64]:
    """A bright rectangle on the wall; height in degrees."""
    rows = int(_HEIGHT * rng.uniform(0.08, 0.3))
    columns = int(_WIDTH * rng.uniform(0.05, 0.2))
    row = int(np.clip(_HEIGHT * (0.5 - rng.uniform(*height) / 180.0) - rows / 2, 0, _HEIGHT - rows))
    across = (int(rng.integers(_WIDTH)) + np.arange(columns)) % _WIDTH
    out = light.copy()
    out[row : row + rows, across] = rng.uniform(*strength) * colour
    return out
