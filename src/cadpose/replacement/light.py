"""The light of a photo, guessed from the object whose shape and pose are known.

Ambient light and one lamp (the first order of spherical harmonics, without its negative half): a surface
of normal n is lit by A + K max(n · d, 0). Pixels are pooled by their normal, and each pool counts by its
median, so that tyres, windows and print, which have a colour of their own, do little.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask
from cadpose.replacement.linear import LUMA, Reals, linear, luminance
from cadpose.replacement.surface import Surface
from cadpose.replacement.window import Window

#: Below this confidence the object's shading tells too little, and light is that of an overcast day.
LEAST_CONFIDENCE = 0.25
_FEWEST_PIXELS, _FEWEST_POOLS = 6, 8
# A lamp stands above the ground by at least this sine: what is lit from below is mostly a wrong pose.
_LOWEST = 0.15
# Lamp over ambient: a clear sky at noon gives about this.
_MOST_CONTRAST = 4.0
# No paint reflects more.
_BRIGHTEST_PAINT = 0.75
# How much of what surroundings reflect a picture shows on average.
_MEAN_REFLECTANCE = 0.25


@dataclass(frozen=True, slots=True)
class Light:
    """Light on the object, in linear values: 1 shows a material's own colour.

    Attributes:
        direction: Unit vector towards the lamp, camera frame (x right, y down, z forward).
        ambient: Intensity from all around.
        key: What the lamp adds on a surface that faces it.
        colour: Its (red, green, blue), mean luminance 1.
        confidence: Share of the shading that the lamp explains, in [0, 1].
        guessed: Whether direction and strength were read from the photo; otherwise they are the default.
    """

    direction: tuple[float, float, float]
    ambient: float
    key: float
    colour: tuple[float, float, float]
    confidence: float
    guessed: bool

    def on(self, normals: Reals) -> NDArray[np.float32]:
        """(..., 3) unit normals to (..., 3) linear RGB intensity."""
        facing = np.maximum(normals @ np.array(self.direction, np.float32), 0.0)
        lit = (self.ambient + self.key * facing)[..., None] * np.array(self.colour, np.float32)
        return np.asarray(lit, np.float32)


def even_light(up_cv: FloatArray) -> Light:
    """What is used where no light is wanted: colours as they are, modelled by a weak light from above."""
    return _overcast(up_cv, 1.0, (1.0, 1.0, 1.0), 0.0)


def guess_light(
    photo_rgb: NDArray[np.uint8],
    seen: Mask,
    surface: Surface,
    up_cv: FloatArray,
    surroundings: Mask,
    window: Window,
) -> Light:
    """The light on an object.

    Args:
        photo_rgb: (H, W, 3) uint8 photo.
        seen: (h, w) the object's pixels within the window.
        surface: (h, w) the object's CAD model as the photo's camera sees it within the window.
        up_cv: (3,) the ground's normal, camera frame.
        surroundings: (H, W) pixels whose colour and brightness tell how much light there is.
        window: The part of the photo in which the model was drawn.
    """
    level, colour = _level(linear(photo_rgb[surroundings]))
    photo_rgb = photo_rgb[window.slices]
    light = linear(photo_rgb)
    known = seen & (surface.coverage > 0.99) & (np.linalg.norm(surface.normals, axis=-1) > 0.5)
    # Burnt out and pitch black pixels tell no shading.
    bright = photo_rgb.max(axis=-1)
    known &= (bright < 252) & (bright > 3)
    if known.sum() >= _FEWEST_PIXELS:
        # What stands among dark things may be bright: then there is more light than they tell.
        level = max(level, min(float(np.quantile(luminance(light[known]), 0.9)) / _BRIGHTEST_PAINT, 1.25))
    pools = _pools(surface.normals[known].astype(np.float64), luminance(light[known]).astype(np.float64))
    if pools is None:
        return _overcast(up_cv, level, colour, 0.0)
    direction, ambient, key, confidence = _fit(*pools, up_cv)
    if confidence < LEAST_CONFIDENCE or key <= 0.0:
        return _overcast(up_cv, level, colour, confidence)
    ratio = min(key / max(ambient, 0.05 * key), _MOST_CONTRAST)
    # What the level was read from is turned all ways: the ground as the lamp stands, walls about half.
    x, y, z = direction
    ambient = level / (1.0 + ratio * max(float(direction @ up_cv), 0.5))
    return Light((float(x), float(y), float(z)), ambient, ratio * ambient, colour, confidence, True)


def _overcast(
    up_cv: FloatArray, level: float, colour: tuple[float, float, float], confidence: float
) -> Light:
    # A little from the camera's side: what a photographer sees is seldom all in shade.
    direction = np.add(up_cv, (0.0, 0.0, -0.35))
    x, y, z = direction / np.linalg.norm(direction)
    return Light((float(x), float(y), float(z)), 0.55 * level, 0.45 * level, colour, confidence, False)


def _level(light: Reals) -> tuple[float, tuple[float, float, float]]:
    """Intensity and colour of the light by the grey-world assumption, half believed for the colour."""
    if not len(light):
        return 1.0, (1.0, 1.0, 1.0)
    # Lamps and sky shine themselves: they count no more than white paper.
    mean = np.minimum(light, np.quantile(light, 0.95)).mean(axis=0)
    level = float(np.clip(mean @ LUMA / _MEAN_REFLECTANCE, 0.12, 1.25))
    cast = (np.maximum(mean, 1e-3) / max(float(mean @ LUMA), 1e-3)) ** 0.5
    cast = np.clip(cast, 0.6, 1.5)
    red, green, blue = cast / float(cast @ LUMA)
    return level, (float(red), float(green), float(blue))


def _pools(normals: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray] | None:
    """(N, 3) mean normals, (N,) median luminances and (N,) weights of pixels whose normals agree."""
    if len(values) < _FEWEST_POOLS * _FEWEST_PIXELS:
        return None
    cell = np.floor((normals + 1.0) * 6.0).astype(np.int64)
    key = (cell[:, 0] * 16 + cell[:, 1]) * 16 + cell[:, 2]
    order = np.argsort(key, kind="stable")
    cuts = np.flatnonzero(np.diff(key[order])) + 1
    means, medians, weights = [], [], []
    for group in np.split(order, cuts):
        if len(group) < _FEWEST_PIXELS:
            continue
        means.append(normals[group].mean(axis=0))
        medians.append(np.median(values[group]))
        weights.append(np.sqrt(len(group)))
    if len(means) < _FEWEST_POOLS:
        return None
    told = np.array(means)
    return told / np.linalg.norm(told, axis=1, keepdims=True), np.array(medians), np.array(weights)


def _fit(
    normals: FloatArray, values: FloatArray, weights: FloatArray, up_cv: FloatArray
) -> tuple[FloatArray, float, float, float]:
    """Direction, ambient, key and confidence: every direction is tried, then those about the best."""
    directions = _sphere(600)
    directions = directions[directions @ up_cv >= _LOWEST]
    best = _best(directions, normals, values, weights, up_cv)
    for spread in (0.12, 0.04):
        x = best[0]
        near = x + spread * _sphere(160)
        near /= np.linalg.norm(near, axis=1, keepdims=True)
        near = near[near @ up_cv >= _LOWEST]
        if len(near):
            best = min(best, _best(near, normals, values, weights, up_cv), key=lambda told: told[4])
    return best[:4]


def _best(
    directions: FloatArray, normals: FloatArray, values: FloatArray, weights: FloatArray, up_cv: FloatArray
) -> tuple[FloatArray, float, float, float, float]:
    """As `_fit`, of these directions; last what was minimised."""
    facing = np.maximum(normals @ directions.T, 0.0)
    robust = np.broadcast_to(weights[:, None], facing.shape).copy()
    for _ in range(4):
        total = robust.sum(axis=0)
        mean_f = (robust * facing).sum(axis=0) / total
        mean_v = (robust * values[:, None]).sum(axis=0) / total
        off = facing - mean_f
        key = (robust * off * (values[:, None] - mean_v)).sum(axis=0)
        key = np.maximum(key / np.maximum((robust * off**2).sum(axis=0), 1e-9), 0.0)
        # Neither part is negative: all of it is the lamp's then.
        ambient = mean_v - key * mean_f
        alone = (robust * facing * values[:, None]).sum(axis=0)
        alone = alone / np.maximum((robust * facing**2).sum(axis=0), 1e-9)
        key = np.where(ambient < 0.0, alone, key)
        ambient = np.maximum(ambient, 0.0)
        left = values[:, None] - ambient - key * facing
        scale = 1.4826 * np.median(np.abs(left), axis=0) + 1e-4
        # Tukey's biweight would forget half of the object; Huber's only counts far ones less.
        robust = weights[:, None] * np.minimum(1.0, 1.345 * scale / np.maximum(np.abs(left), 1e-9))
    even = np.abs(values - _weighted_median(values, weights))
    cost = (weights[:, None] * np.abs(left)).sum(axis=0) / max(float((weights * even).sum()), 1e-9)
    # Between two that explain alike, the higher lamp is likelier.
    wanted = cost + 0.03 * (1.0 - directions @ up_cv)
    i = int(np.argmin(wanted))
    confidence = float(np.clip(1.0 - cost[i], 0.0, 1.0))
    return directions[i], float(ambient[i]), float(key[i]), confidence, float(wanted[i])


def _weighted_median(values: FloatArray, weights: FloatArray) -> float:
    order = np.argsort(values)
    at = np.searchsorted(np.cumsum(weights[order]), 0.5 * weights.sum())
    return float(values[order[min(int(at), len(order) - 1)]])


def _sphere(count: int) -> FloatArray:
    """(count, 3) unit vectors, evenly spread (Fibonacci's spiral)."""
    i = np.arange(count) + 0.5
    y = 1.0 - 2.0 * i / count
    turn = np.pi * (1.0 + 5.0**0.5) * i
    r = np.sqrt(1.0 - y * y)
    return np.stack([r * np.cos(turn), y, r * np.sin(turn)], axis=1)
