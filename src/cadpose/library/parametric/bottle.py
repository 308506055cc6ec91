"""Bottles: wine, beer, water, drinks, sauce, shampoo, detergent, spray and perfume; labels face -z."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import picture_paint, random_word, text_picture
from cadpose.library.parametric.finishes import BLACK, CHROME, WHITE
from cadpose.library.parametric.hulls import tower
from cadpose.library.parametric.paints import Colour, any_colour, plain
from cadpose.library.parametric.shapes import bar, box, cylinder, grid, lathe, rounded_box, smooth_path, tube
from cadpose.library.parametric.solids import Array, Builder, Paint, Solid

_PAPERS = ((244, 240, 226), (250, 250, 250), (30, 30, 34), (190, 30, 36), (30, 70, 150), (30, 120, 60), (240,
    200, 60))  # fmt: skip


def bottle(rng: Generator) -> Mesh:
    """Any kind of bottle."""
    kinds = (_wine, _beer, _water, _soda, _sauce, _shampoo, _detergent, _spray, _perfume, _flask)
    kind = kinds[int(rng.choice(len(kinds), p=[0.17, 0.12, 0.13, 0.1, 0.09, 0.11, 0.08, 0.06, 0.07, 0.07]))]
    build = Builder()
    kind(build, rng)
    return build.mesh("bottle")


def _turned(
    build: Builder, paint: Paint, profile: list[tuple[float, float]], steps: int = 3, sides: int = 28
) -> None:
    """A lathe through a smoothed profile of (radius, y)."""
    curve = smooth_path(np.array(profile), steps)
    # The curve may swing out beyond its corners; a label would then lie under the surface.
    most = max(r for r, _ in profile)
    build.add(paint, lathe([(min(max(float(r), 1e-4), most), float(y)) for r, y in curve], sides))


def _label(
    build: Builder, rng: Generator, radius: float, low: float, high: float, around: bool | None = None
) -> None:
    """A printed label: a band of one colour with a picture on the front, or the front alone."""
    paper = _PAPERS[int(rng.integers(len(_PAPERS)))]
    ink = (245, 245, 240) if sum(paper) < 400 else [(25, 25, 28), (140, 20, 30), (30, 50,
        110)][int(rng.integers(3))]  # fmt: skip
    wide = 2 * radius
    tall = (high - low) / wide
    words = [(random_word(rng, int(rng.integers(3, 7))), 0.5, 0.5 - 0.2 * tall, min(0.17, 0.26 * tall))]
    lines = int(rng.integers(1, 4))
    for k in range(lines):
        line = random_word(rng, int(rng.integers(5, 11)))
        words += [(line, 0.5, 0.5 + (0.08 + 0.11 * k) * tall, 0.08 * tall)]
    picture = text_picture(128, words, paper, ink)
    if rng.random() < 0.6:
        stripe = int(128 * (0.5 + rng.uniform(0.3, 0.42) * min(tall, 1.0)))
        picture = picture.copy()
        picture[stripe : stripe + 6] = ink
    whole = rng.random() < 0.5 if around is None else around
    r, g, b = (c / 255 for c in paper)
    band = plain((r, g, b), "label")
    middle = (low + high) / 2
    rim = 1.012 * radius

    def arc(start: float, end: float, count: int, out: float = 0.0) -> Solid:
        turn = np.radians(np.linspace(start, end, count))
        flat = np.stack([(rim + out) * np.sin(turn), np.zeros(count), -(rim + out) * np.cos(turn)], 1)
        return grid(np.stack([flat + np.array([0, y - middle, 0]) for y in (low, high)]))

    build.add(picture_paint(picture, wide, "label"), arc(-43, 43, 9).moved(0, middle, 0))
    for start, end in ((43, 317),) if whole else ((-78, -43), (43, 78)):
        build.add(band, arc(start, end, 21 if whole else 5).moved(0, middle, 0))


def _wine(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    glass = plain([(0.06, 0.16, 0.07), (0.04, 0.07, 0.04), (0.20, 0.28, 0.08), (0.22, 0.10, 0.03), (0.7,
        0.75, 0.68)][int(rng.integers(5))], "glass")  # fmt: skip
    r, high = u(0.036, 0.046), u(0.29, 0.33)
    slope = rng.random() < 0.5
    shoulder = 0.62 * high if not slope else 0.48 * high
    neck = 0.72 * high
    body = [(0.88 * r, 0.0), (r, 0.008), (r, 0.3 * shoulder), (r, shoulder), (0.9 * r,
        shoulder + 0.3 * (neck - shoulder)), (0.4 * r, neck), (0.36 * r, 0.85 * high), (0.36 * r,
        0.95 * high)]  # fmt: skip
    _turned(build, glass, body)
    build.add(glass, cylinder(0.43 * r, 0.012, (0, 0.945 * high, 0), 16))
    foil = plain([(0.1, 0.1, 0.1), (0.5, 0.06, 0.1), (0.78, 0.64, 0.3), (0.12, 0.2,
        0.4)][int(rng.integers(4))], "foil")  # fmt: skip
    build.add(foil, lathe([(0.41 * r, 0.8 * high), (0.40 * r, 0.95 * high), (0.45 * r, 0.955 * high),
        (0.44 * r, high)], 18))  # fmt: skip
    top = 0.95 * shoulder
    _label(build, rng, r, top - u(0.07, 0.1), top, False)


def _beer(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    glass = plain([(0.26, 0.12, 0.03), (0.20, 0.09, 0.02), (0.06, 0.25, 0.09), (0.75, 0.78,
        0.7)][int(rng.integers(4))], "glass")  # fmt: skip
    r, high = u(0.029, 0.034), u(0.2, 0.26)
    shoulder = u(0.5, 0.6) * high
    _turned(build, glass, [(0.88 * r, 0.0), (r, 0.006), (r, 0.3 * shoulder), (r, shoulder), (0.85 * r,
        shoulder + 0.1 * high), (0.46 * r, 0.8 * high), (0.4 * r, 0.96 * high)])  # fmt: skip
    cap = plain([(0.8, 0.66, 0.2), (0.7, 0.1, 0.1), (0.78, 0.79, 0.8), (0.1, 0.35,
        0.2)][int(rng.integers(4))], "crown cap")  # fmt: skip
    build.add(cap, lathe([(0.5 * r, 0.955 * high), (0.48 * r, 0.975 * high), (0.38 * r, 0.985 * high)], 21))
    _label(build, rng, r, 0.35 * shoulder, 0.95 * shoulder)
    if rng.random() < 0.5:
        build.add(cap, lathe([(0.60 * r, 0.72 * high), (0.5 * r, 0.82 * high)], 20))


def _water(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    tint: Colour = [(0.62, 0.78, 0.90), (0.75, 0.84, 0.88), (0.55, 0.80, 0.72)][int(rng.integers(3))]
    look = plain(tint, "PET", float(u(0.45, 0.8)))
    r, high = u(0.031, 0.045), u(0.2, 0.33)
    profile = [(0.8 * r, 0.0), (r, 0.04 * high)]
    for k in range(int(rng.integers(3, 6))):
        y = (0.08 + 0.09 * k) * high
        profile += [(r, y), (0.92 * r, y + 0.045 * high)]
    waist = u(0.84, 1.0)
    profile += [(r, 0.58 * high), (waist * r, 0.66 * high), (0.98 * r, 0.74 * high), (0.7 * r, 0.85 * high),
        (0.36 * r, 0.92 * high), (0.34 * r, 0.95 * high)]  # fmt: skip
    _turned(build, look, profile, 2)
    cap = plain([(0.15, 0.35, 0.75), (0.92, 0.92, 0.92), (0.1, 0.55, 0.75), (0.75, 0.1,
        0.12)][int(rng.integers(4))], "cap")  # fmt: skip
    build.add(cap, cylinder(0.42 * r, 0.055 * high, (0, 0.945 * high, 0), 16))
    _label(build, rng, 1.01 * r, 0.38 * high, 0.58 * high, True)


def _soda(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    drink = plain([(0.16, 0.06, 0.03), (0.95, 0.5, 0.08), (0.85, 0.9, 0.75), (0.75, 0.1, 0.12), (0.9, 0.8,
        0.2)][int(rng.integers(5))], "drink")  # fmt: skip
    r, high = u(0.034, 0.05), u(0.22, 0.34)
    waist = u(0.86, 1.0)
    _turned(build, drink, [(0.7 * r, 0.0), (0.97 * r, 0.05 * high), (r, 0.12 * high), (waist * r,
        0.3 * high), (r, 0.5 * high), (r, 0.62 * high), (0.75 * r, 0.76 * high), (0.42 * r, 0.88 * high),
        (0.34 * r, 0.94 * high)])  # fmt: skip
    build.add(plain(any_colour(rng), "cap"), cylinder(0.4 * r, 0.06 * high, (0, 0.935 * high, 0), 16))
    _label(build, rng, 1.01 * r, 0.42 * high, 0.66 * high, True)


def _sauce(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    look = plain([(0.72, 0.08, 0.05), (0.93, 0.75, 0.12), (0.94, 0.92, 0.82), (0.25, 0.1, 0.04), (0.35, 0.5,
        0.15)][int(rng.integers(5))], "sauce")  # fmt: skip
    r, high = u(0.03, 0.038), u(0.16, 0.21)
    cap = WHITE if rng.random() < 0.5 else plain(any_colour(rng), "cap")
    _turned(build, look, [(0.85 * r, 0.0), (r, 0.01), (r, 0.2 * high), (u(0.85, 1.0) * r, 0.5 * high),
        (0.8 * r, 0.66 * high), (0.45 * r, 0.78 * high), (0.4 * r, 0.82 * high)])  # fmt: skip
    if rng.random() < 0.5:
        build.add(cap, lathe([(0.46 * r, 0.8 * high), (0.46 * r, 0.87 * high), (0.2 * r, 0.9 * high),
            (0.07 * r, high)], 16))  # fmt: skip
    else:
        build.add(cap, cylinder(0.5 * r, 0.14 * high, (0, 0.81 * high, 0), 18))
    _label(build, rng, r, 0.1 * high, 0.42 * high)


def _shampoo(build: Builder, rng: Generator) -> None:
    """Flat, with a flip cap or a pump whose spout looks to -z."""
    u = rng.uniform
    look = WHITE if rng.random() < 0.25 else plain(any_colour(rng), "plastic")
    cap = WHITE if rng.random() < 0.5 else (BLACK if rng.random() < 0.3 else plain(any_colour(rng), "cap"))
    wide, deep, high = u(0.03, 0.042), u(0.02, 0.03), u(0.15, 0.2)
    square = u(0.4, 1.0)
    top = u(0.5, 0.85)
    rows = [(0.0, 0.0, 0.9 * wide, 0.9 * deep), (0.006, 0.0, wide, deep), (0.5 * high, 0.0, u(0.9,
        1.05) * wide, deep), (0.88 * high, 0.0, top * wide, 0.85 * deep), (0.96 * high, 0.0, 0.55 * wide,
        0.55 * deep), (high, 0.0, 0.012, 0.012)]  # fmt: skip
    build.add(look, tower(rows, square, 24))
    ink = (250, 250, 250) if sum(look.material.rgba[:3]) < 1.7 else (30, 30, 60)
    r, g, b = (int(255 * c) for c in look.material.rgba[:3])
    words = [(random_word(rng, 5), 0.5, 0.3, 0.16), (random_word(rng, 8), 0.5, 0.52, 0.09), (random_word(rng,
        9), 0.5, 0.66, 0.08)]  # fmt: skip
    picture = text_picture(96, words, (r, g, b), ink)
    x = np.linspace(-0.62, 0.62, 9)
    z = -1.01 * deep * (1 - np.abs(x) ** (2 / square)) ** (square / 2)
    print_ = np.stack([np.stack([x * wide, np.full(9, y), z], 1) for y in (-0.22 * high, 0.22 * high)])
    build.add(picture_paint(picture, 1.3 * wide, "print"), grid(print_).moved(0, 0.36 * high, 0))
    if rng.random() < 0.5:
        build.add(
            cap, cylinder(0.013, 0.016, (0, high - 0.003, 0), 16), cylinder(0.005, 0.035, (0, high, 0), 10)
        )
        build.add(
            cap,
            rounded_box((0.018, 0.011, 0.022), (0, high + 0.035, 0), 0.004),
            bar((0, high + 0.036, 0), (0, high + 0.032, -0.04), 0.008),
        )
    else:
        build.add(cap, tower([(0.93 * high, 0.0, 0.62 * wide, 0.7 * deep), (high + 0.02, 0.0, 0.55 * wide,
            0.6 * deep)], square, 20))  # fmt: skip


def _detergent(build: Builder, rng: Generator) -> None:
    """A flat jug; its handle is at the own left, its label in front."""
    u = rng.uniform
    look = plain(any_colour(rng), "plastic") if rng.random() < 0.75 else WHITE
    cap = plain(any_colour(rng), "cap")
    wide, deep, high = u(0.085, 0.11), u(0.04, 0.055), u(0.22, 0.28)
    rows = [(0.0, 0.0, 0.95 * wide, 0.92 * deep), (0.01, 0.0, wide, deep), (0.55 * high, 0.0, wide, deep)]
    build.add(look, tower(rows, 0.45, 24))
    shoulder = [(0.54 * high, 0.0, 0.98 * wide, 0.98 * deep), (0.64 * high, 0.0, 0.72 * wide, 0.9 * deep),
        (0.86 * high, 0.0, 0.36 * wide, 0.6 * deep), (0.93 * high, 0.0, 0.26 * wide, 0.026)]  # fmt: skip

    def aside(points: Array) -> Array:
        rise = (points[:, 1] / high - 0.54) / 0.36
        return points + np.clip(rise, 0, 1)[:, None] * (0.26 * wide, 0.0, 0.0)

    build.add(look, tower(shoulder, 0.6, 22).warped(aside))
    grip = smooth_path(np.array([(0.0, 0.9 * high, 0), (-0.45 * wide, 0.9 * high, 0), (-0.82 * wide,
        0.76 * high, 0), (-0.84 * wide, 0.5 * high, 0)]), 4)  # fmt: skip
    build.add(look, tube(grip, 0.017, 10))
    build.add(cap, lathe([(0.03, 0.92 * high), (0.032, 0.94 * high), (0.028, high + 0.03)], 20, (0.26 * wide,
        0, 0)))  # fmt: skip
    paper = _PAPERS[int(rng.integers(len(_PAPERS)))]
    words = [(random_word(rng, 5), 0.5, 0.4, 0.2), (random_word(rng, 8), 0.5, 0.58, 0.09)]
    picture = text_picture(128, words, paper, (250, 250, 250) if sum(paper) < 400 else (180, 20, 40))
    for z, front in ((-deep - 0.001, True), (deep + 0.001, False)):
        build.add(
            picture_paint(picture, 1.5 * wide, "label", front),
            box((1.5 * wide, 0.4 * high, 0.003)).moved(0, 0.28 * high, z),
        )


def _spray(build: Builder, rng: Generator) -> None:
    """A trigger sprayer; its nozzle looks to -z."""
    u = rng.uniform
    look = plain(any_colour(rng), "plastic", float(u(0.6, 1.0)))
    head = WHITE if rng.random() < 0.5 else plain(any_colour(rng), "head")
    r, high = u(0.036, 0.045), u(0.17, 0.21)
    _turned(build, look, [(0.9 * r, 0.0), (r, 0.008), (r, 0.35 * high), (u(0.85, 1) * r, 0.6 * high),
        (0.75 * r, 0.8 * high), (0.34 * r, 0.94 * high), (0.32 * r, high)])  # fmt: skip
    _label(build, rng, r, 0.08 * high, 0.42 * high)
    build.add(head, cylinder(0.42 * r, 0.022, (0, high - 0.008, 0), 16))
    build.add(
        head,
        rounded_box((0.026, 0.03, 0.075), (0, high + 0.035, -0.012), 0.008),
        box((0.02, 0.025, 0.02), (0, high + 0.015, 0)),
    )
    build.add(
        BLACK if rng.random() < 0.5 else head,
        cylinder(0.009, 0.015, sides=10).turned("x", -90).moved(0, high + 0.038, -0.048),
    )
    build.add(head, tube(smooth_path(np.array([(0, high + 0.022, -0.028), (0, high, -0.038), (0,
        high - 0.025, -0.034)]), 3), 0.006, 6))  # fmt: skip


def _perfume(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    tint = [(0.95, 0.82, 0.62), (0.93, 0.72, 0.74), (0.7, 0.82, 0.92), (0.12, 0.12, 0.16), (0.75, 0.6, 0.85),
        (0.3, 0.5, 0.42)][int(rng.integers(6))]  # fmt: skip
    look = plain(tint, "glass", float(u(0.6, 1.0)))
    cap = [CHROME, BLACK, plain((0.8, 0.66, 0.32), "gold")][int(rng.integers(3))]
    wide, deep, high = u(0.05, 0.075), u(0.022, 0.04), u(0.06, 0.1)
    shape = int(rng.integers(3))
    if shape == 0:
        build.add(look, rounded_box((wide, high, deep), (0, high / 2, 0), 0.004))
    elif shape == 1:
        build.add(look, tower([(0.0, 0.0, 0.3 * wide, 0.4 * deep), (0.3 * high, 0.0, 0.55 * wide,
            0.5 * deep), (0.75 * high, 0.0, 0.5 * wide, 0.45 * deep), (high, 0.0, 0.2 * wide, 0.3 * deep)],
            0.8, 22))  # fmt: skip
    else:
        build.add(look, tower([(0.0, 0.0, 0.5 * wide, 0.5 * deep), (0.8 * high, 0.0, 0.42 * wide,
            0.42 * deep), (high, 0.0, 0.2 * wide, 0.3 * deep)], 0.2, 20))  # fmt: skip
    build.add(CHROME, cylinder(0.009, 0.012, (0, high - 0.001, 0), 14))
    size = u(0.018, 0.03)
    if rng.random() < 0.5:
        build.add(cap, cylinder(0.5 * size + 0.003, 1.1 * size, (0, high + 0.008, 0), 18))
    else:
        build.add(
            cap, rounded_box((size, size, min(size, 0.9 * deep)), (0, high + 0.008 + size / 2, 0), 0.002)
        )
    words = [(random_word(rng, 4), 0.5, 0.45, 0.2), (random_word(rng, 7), 0.5, 0.62, 0.08)]
    picture = text_picture(96, words, (238, 232, 220), (40, 34, 30))
    build.add(
        picture_paint(picture, 0.55 * wide, "label"),
        box((0.55 * wide, 0.4 * high, 0.002)).moved(0, 0.42 * high, -0.51 * deep - 0.0005),
    )


def _flask(build: Builder, rng: Generator) -> None:
    """A sports or thermos bottle."""
    u = rng.uniform
    look = plain(any_colour(rng), "flask") if rng.random() < 0.7 else CHROME
    cap = BLACK if rng.random() < 0.6 else plain(any_colour(rng), "cap")
    r, high = u(0.034, 0.04), u(0.2, 0.27)
    _turned(build, look, [(0.92 * r, 0.0), (r, 0.008), (r, 0.3 * high), (r, 0.68 * high), (0.92 * r,
        0.76 * high), (0.72 * r, 0.83 * high), (0.7 * r, 0.87 * high)])  # fmt: skip
    build.add(cap, lathe([(0.78 * r, 0.86 * high), (0.78 * r, 0.97 * high), (0.6 * r, high)], 20))
    if rng.random() < 0.6:
        t = np.linspace(0, np.pi, 9)
        loop = np.stack([0.6 * r * np.cos(t), 0.98 * high + 0.7 * r * np.sin(t), np.zeros(9)], 1)
        build.add(cap, tube(loop, 0.005, 6))
    else:
        build.add(cap, lathe([(0.3 * r, high - 0.003), (0.3 * r, high + 0.012), (0.16 * r, high + 0.03)], 12))
    if rng.random() < 0.5:
        _label(build, rng, r, 0.2 * high, 0.5 * high, False)
