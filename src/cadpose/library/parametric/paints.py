"""Materials as found in rooms and streets, drawn at random: wood, fabric, leather, metal, plastic."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from cadpose.library.mesh import Material
from cadpose.library.parametric.solids import Paint

_SIDE = 64  # a texture's side in pixels: at 4096 pixels it is stored without loss

Colour = tuple[float, float, float]

_WOODS: tuple[Colour, ...] = (
    (0.87, 0.76, 0.58), (0.80, 0.64, 0.44), (0.72, 0.52, 0.33), (0.60, 0.40, 0.24), (0.47, 0.29, 0.17),
    (0.36, 0.21, 0.12), (0.24, 0.15, 0.10), (0.55, 0.27, 0.17), (0.70, 0.62, 0.52), (0.45, 0.42, 0.38),
)  # fmt: skip
_FABRICS: tuple[Colour, ...] = (
    (0.78, 0.76, 0.72), (0.62, 0.60, 0.57), (0.45, 0.45, 0.46), (0.28, 0.29, 0.31), (0.86, 0.81, 0.71),
    (0.72, 0.64, 0.52), (0.30, 0.38, 0.48), (0.20, 0.26, 0.40), (0.36, 0.46, 0.42), (0.52, 0.55, 0.38),
    (0.62, 0.24, 0.20), (0.74, 0.46, 0.22), (0.80, 0.66, 0.28), (0.55, 0.38, 0.46), (0.42, 0.30, 0.24),
    (0.92, 0.90, 0.87), (0.25, 0.42, 0.44), (0.80, 0.58, 0.56),
)  # fmt: skip
_LEATHERS: tuple[Colour, ...] = (
    (0.12, 0.11, 0.11), (0.30, 0.18, 0.12), (0.45, 0.26, 0.16), (0.62, 0.40, 0.24), (0.88, 0.84, 0.77),
    (0.93, 0.92, 0.90), (0.45, 0.12, 0.11), (0.24, 0.27, 0.24), (0.36, 0.34, 0.33),
)  # fmt: skip
_METALS: tuple[Colour, ...] = (
    (0.78, 0.79, 0.81), (0.62, 0.63, 0.65), (0.14, 0.14, 0.15), (0.08, 0.08, 0.09), (0.92, 0.92, 0.92),
    (0.76, 0.64, 0.38), (0.36, 0.34, 0.33),
)  # fmt: skip


def _near(rng: Generator, colour: Colour, spread: float = 0.05) -> Colour:
    shade = rng.normal(0.0, spread)
    r, g, b = (float(np.clip(c + shade + rng.normal(0.0, spread / 4), 0.02, 0.98)) for c in colour)
    return r, g, b


def _pick(rng: Generator, colours: tuple[Colour, ...]) -> Colour:
    return _near(rng, colours[int(rng.integers(len(colours)))])


def _textured(colour: Colour, pattern: NDArray[np.float64], name: str, tile: float, along: bool) -> Paint:
    """The pattern is (H, W) or (H, W, 3) factors about 1."""
    factors = pattern if pattern.ndim == 3 else pattern[..., None]
    texture = np.clip(np.asarray(colour) * factors * 255.0, 0, 255).astype(np.uint8)
    return Paint(Material((1.0, 1.0, 1.0, 1.0), texture, name), tile, along)


def plain(colour: Colour, name: str = "", alpha: float = 1.0) -> Paint:
    """One colour."""
    return Paint(Material((*colour, alpha), None, name))


def any_colour(rng: Generator) -> Colour:
    """Any hue, from pale to strong, not very dark."""
    r, g, b = colorsys.hsv_to_rgb(
        float(rng.random()), float(rng.uniform(0.15, 0.9)), float(rng.uniform(0.3, 0.97))
    )
    return r, g, b


def wood(rng: Generator, textured: float = 0.75) -> Paint:
    """Wood from pale to dark, mostly with grain along the part."""
    colour = _pick(rng, _WOODS)
    if rng.random() > textured:
        return plain(colour, "wood")
    x = np.arange(_SIDE) / _SIDE
    wave = np.zeros((_SIDE, _SIDE))
    # Whole periods along both sides: the texture repeats without a seam.
    for _ in range(7):
        across, down = int(rng.integers(2, 16)), int(rng.integers(0, 2))
        bow = rng.uniform(0.0, 0.6) * np.sin(2 * np.pi * (x[:, None] + rng.random()))
        phase = 2 * np.pi * (across * x[None] + down * x[:, None] + rng.random())
        wave += rng.uniform(0.3, 1.0) * np.sin(phase + bow)
    wave += rng.normal(0.0, 0.6, (1, _SIDE)) + rng.normal(0.0, 0.3, (_SIDE, _SIDE))
    return _textured(colour, 1.0 + rng.uniform(0.03, 0.07) * wave, "wood", float(rng.uniform(0.3, 0.6)), True)


def painted(rng: Generator) -> Paint:
    """Lacquer: white, black, grey or a colour."""
    kind = rng.random()
    if kind < 0.4:
        return plain(_near(rng, (0.92, 0.91, 0.88), 0.03), "lacquer")
    if kind < 0.55:
        return plain(_near(rng, (0.10, 0.10, 0.11), 0.03), "lacquer")
    if kind < 0.7:
        return plain(_near(rng, (0.50, 0.50, 0.50), 0.12), "lacquer")
    return plain(any_colour(rng), "lacquer")


def fabric(rng: Generator, patterned: float = 0.2) -> Paint:
    """Cloth: woven, or with stripes, checks or dots now and then."""
    colour = _pick(rng, _FABRICS) if rng.random() < 0.85 else any_colour(rng)
    i, j = np.mgrid[:_SIDE, :_SIDE]
    weave = 1.0 + 0.04 * ((i // 2 + j // 2) % 2 * 2 - 1) + rng.normal(0.0, 0.03, (_SIDE, _SIDE))
    if rng.random() >= patterned:
        return _textured(colour, weave, "fabric", 0.12, False)
    other = np.asarray(_pick(rng, _FABRICS)) / np.maximum(np.asarray(colour), 0.02)
    width = int(2 ** rng.integers(3, 6))
    kind = int(rng.integers(4))
    if kind == 0:
        mark = (j % width) < width * rng.uniform(0.2, 0.6)
    elif kind == 1:
        mark = ((i // (width // 2)) + (j // (width // 2))) % 2 == 0
    elif kind == 2:
        mark = ((i % width) < width / 4) | ((j % width) < width / 4)
    else:
        mark = np.hypot(i % width - width / 2, j % width - width / 2) < width * 0.3
    factors = np.where(mark[..., None], other, 1.0) * weave[..., None]
    return _textured(colour, factors, "fabric", float(rng.uniform(0.2, 0.5)), False)


def leather(rng: Generator) -> Paint:
    """Leather, one colour."""
    return plain(_pick(rng, _LEATHERS), "leather")


def upholstery(rng: Generator) -> Paint:
    """Fabric or leather."""
    return leather(rng) if rng.random() < 0.3 else fabric(rng)


def metal(rng: Generator) -> Paint:
    """Steel, chrome, black or brass."""
    return plain(_near(rng, _METALS[int(rng.integers(len(_METALS)))], 0.03), "metal")


def plastic(rng: Generator) -> Paint:
    """White, black or any colour."""
    kind = rng.random()
    if kind < 0.3:
        return plain(_near(rng, (0.90, 0.90, 0.89), 0.03), "plastic")
    if kind < 0.5:
        return plain(_near(rng, (0.12, 0.12, 0.13), 0.03), "plastic")
    return plain(any_colour(rng), "plastic")


def wicker(rng: Generator) -> Paint:
    """Woven cane."""
    colour = _pick(rng, _WOODS[:6])
    i, j = np.mgrid[:_SIDE, :_SIDE]
    over = ((i // 8 + j // 8) % 2 == 0).astype(np.float64)
    round_ = np.where(over > 0, np.sin(np.pi * (i % 8 + 0.5) / 8), np.sin(np.pi * (j % 8 + 0.5) / 8))
    return _textured(colour, 0.5 + 0.6 * round_, "wicker", 0.12, False)


def glass(rng: Generator) -> Paint:
    """Clear or tinted."""
    return plain(_near(rng, (0.72, 0.80, 0.80), 0.05), "glass", 0.35)


def darker(paint: Paint, factor: float = 0.7) -> Paint:
    """The same look, darker (or paler with a factor above 1)."""
    material = paint.material
    if material.texture is not None:
        texture = np.clip(material.texture * factor, 0, 255).astype(np.uint8)
        return Paint(Material(material.rgba, texture, material.name), paint.tile, paint.along)
    r, g, b = (min(1.0, c * factor) for c in material.rgba[:3])
    return Paint(Material((r, g, b, material.rgba[3]), None, material.name), paint.tile, paint.along)
