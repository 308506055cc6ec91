"""Motorbikes: naked, sport, cruiser, scooter and dirt bike."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.finishes import AMBER, BLACK, CHROME, STEEL
from cadpose.library.parametric.hulls import hull
from cadpose.library.parametric.motorbike_bodies import COLOURS, Chassis, add_body
from cadpose.library.parametric.paints import plain
from cadpose.library.parametric.shapes import bar, box, cylinder, ellipsoid, smooth_path, tube
from cadpose.library.parametric.solids import Array, Builder
from cadpose.library.parametric.wheels import RUBBER, along_x, cast_wheel, spoked_wheel

STYLES = ("naked", "sport", "cruiser", "scooter", "dirt")
_SHARE = (0.24, 0.2, 0.2, 0.22, 0.14)


def motorbike(rng: Generator) -> Mesh:
    """Any kind of motorbike."""
    return motorbike_of_style(rng, STYLES[int(rng.choice(len(STYLES), p=_SHARE))])


def motorbike_of_style(rng: Generator, style: str) -> Mesh:
    """A motorbike of one of `STYLES`."""
    u = rng.uniform
    base = {"naked": 1.42, "sport": 1.40, "cruiser": 1.62, "scooter": 1.30, "dirt": 1.46}[style] * u(
        0.97, 1.04
    )
    front, rear = {
        "naked": (0.30, 0.31),
        "sport": (0.30, 0.31),
        "cruiser": (0.32, 0.32),
        "scooter": (0.235, 0.235),
        "dirt": (0.345, 0.32),
    }[style]
    grow = u(0.97, 1.05) if style != "scooter" else u(0.92, 1.25)
    seat = {"naked": 0.80, "sport": 0.82, "cruiser": 0.69, "scooter": 0.78, "dirt": 0.92}[style] * u(
        0.98, 1.03
    )
    rake = {"naked": 0.25, "sport": 0.24, "cruiser": 0.40, "scooter": 0.24, "dirt": 0.30}[style] * u(
        0.92, 1.08
    )
    top = {"naked": 0.93, "sport": 0.88, "cruiser": 0.95, "scooter": 0.95, "dirt": 1.03}[style]
    dark = rng.random() < 0.5
    bike = Chassis(
        front * grow,
        rear * grow,
        -base / 2,
        base / 2,
        seat,
        (top, -base / 2 + rake),
        plain(COLOURS[int(rng.integers(len(COLOURS)))], "paint"),
        BLACK if rng.random() < 0.7 else plain(COLOURS[int(rng.integers(len(COLOURS)))], "frame"),
        plain((0.2, 0.2, 0.21), "engine") if dark else STEEL,
        plain([(0.09, 0.08, 0.08), (0.09, 0.08, 0.08), (0.36, 0.2, 0.12)][int(rng.integers(3))], "seat"),
        CHROME
        if rng.random() < 0.4
        else plain([(0.1, 0.1, 0.1), (0.7, 0.6, 0.3), (0.6, 0.6, 0.62)][int(rng.integers(3))], "rim"),
    )
    build = Builder()
    _wheels(build, bike, rng, style)
    _fork(build, bike, rng, style)
    if style != "scooter":
        _engine(build, bike, rng, style)
        _exhaust(build, bike, rng, style)
    add_body(build, bike, rng, style)
    return build.mesh("motorbike")


def _wheels(build: Builder, bike: Chassis, rng: Generator, style: str) -> None:
    wire = style == "dirt" or (style == "cruiser" and rng.random() < 0.6) or rng.random() < 0.1
    spokes = int(rng.choice([3, 5, 6, 8]))
    wide = {"naked": (0.12, 0.17), "sport": (0.12, 0.19), "cruiser": (0.13, 0.19), "dirt": (0.09, 0.12)}
    for radius, z, thick in zip(
        (bike.front, bike.rear), (bike.z_front, bike.z_rear), wide.get(style, (0.11, 0.12)), strict=True
    ):
        if wire:
            wheel = spoked_wheel(radius, thick, bike.rim, RUBBER, 20, sides=24, wire=0.004)
        else:
            wheel = cast_wheel(radius, thick, bike.rim, spokes, sides=24)
        build.include(wheel, None, (0, radius, z))
        disc = along_x(cylinder(0.48 * radius, 0.012, sides=16))
        for x in (0.5 * thick + 0.01, -0.5 * thick - 0.02):
            if z < 0 or x > 0:
                build.add(STEEL, disc.moved(x, radius, z))
    if style == "dirt":
        for radius, z, thick in ((bike.front, bike.z_front, 0.09), (bike.rear, bike.z_rear, 0.12)):
            for k in range(16):
                a = 2 * np.pi * k / 16
                block = box((thick * 0.7, 0.03, 0.05)).turned("x", float(np.degrees(a)))
                r = radius - 0.005
                build.add(RUBBER, block.moved(0, radius + r * float(np.cos(a)), z + r * float(np.sin(a))))


def _fork(build: Builder, bike: Chassis, rng: Generator, style: str) -> None:
    """Fork, handlebar, grips, levers, mirrors, indicators."""
    u = rng.uniform
    y, z = bike.head
    apart = 0.09 if style != "cruiser" else 0.105
    foot, knee = np.array([apart, bike.front, bike.z_front]), np.array([apart, y, z])
    middle = foot + 0.5 * (knee - foot)
    low = STEEL if style != "scooter" else BLACK
    build.add(low, tube([foot, middle], 0.028, 8).pair())
    if style != "scooter":
        build.add(CHROME if rng.random() < 0.5 else BLACK, tube([middle, knee], 0.021, 8).pair())
        lean = (z - bike.z_front) / (y - bike.front)
        for down in (0.02, 0.2):
            build.add(BLACK, box((2 * apart + 0.07, 0.03, 0.08), (0, y - down, z - down * lean)))
    rise, back, wide = {
        "naked": (0.10, 0.08, 0.37),
        "sport": (-0.02, 0.04, 0.33),
        "cruiser": (u(0.12, 0.4), 0.22, 0.42),
        "scooter": (0.09, 0.06, 0.33),
        "dirt": (0.13, 0.08, 0.40),
    }[style]
    wide *= u(0.93, 1.06)
    grip: Array = np.array([wide, y + rise, z + back])
    bends = [(0.03, y, z), (0.12, y + 0.4 * rise, z - 0.01), (0.6 * wide, y + rise, z + 0.3 * back)]
    half = smooth_path(np.array([*bends, grip]), 4)
    build.add(CHROME if style == "cruiser" else BLACK, tube(half, 0.013, 7).pair())
    way = (half[-1] - half[-3]) / np.linalg.norm(half[-1] - half[-3])
    build.add(RUBBER, tube([grip - 0.1 * way, grip + 0.03 * way], 0.021, 8).pair())
    lever = grip - 0.11 * way + [0, 0, -0.05]
    build.add(STEEL, tube([lever, lever + 0.13 * way + [0, 0, -0.01]], 0.006, 4).pair())
    if style != "dirt":
        stem = grip - 0.13 * way
        eye = (
            stem + np.array([u(0.03, 0.1), u(0.12, 0.2), 0.02])
            if style != "sport"
            else np.array([0.27, y + 0.14, z - 0.2])
        )
        start = stem if style != "sport" else np.array([0.12, y + 0.03, z - 0.25])
        build.add(BLACK, tube([start, eye], 0.007, 5).pair())
        mirror = ellipsoid((0.065, 0.042 if rng.random() < 0.6 else 0.06, 0.02), tuple(eye), 10)
        build.add(CHROME if style == "cruiser" else BLACK, mirror.pair())
    lamp = (0.17, y - 0.1, z - 0.06) if style != "sport" else (0.2, y - 0.1, z - 0.12)
    if style not in ("dirt", "scooter"):
        build.add(BLACK, bar((0.05, lamp[1], lamp[2]), lamp, 0.014).pair())
        build.add(AMBER, ellipsoid((0.032, 0.025, 0.025), lamp, 8).pair())
        build.add(
            AMBER, ellipsoid((0.03, 0.025, 0.025), (0.15, bike.seat - 0.08, bike.z_rear + 0.05), 8).pair()
        )
        build.add(
            BLACK,
            bar(
                (0.0, bike.seat - 0.08, bike.z_rear + 0.05),
                (0.15, bike.seat - 0.08, bike.z_rear + 0.05),
                0.012,
            ).pair(),
        )


def _engine(build: Builder, bike: Chassis, rng: Generator, style: str) -> None:
    """Engine, frame, swing arm, chain side, pegs and shock absorbers."""
    y, z = bike.head
    low = 0.19 if style != "dirt" else 0.3
    build.add(
        bike.engine,
        hull(
            [
                (-0.22, low + 0.17, 0.13, 0.11),
                (-0.17, low + 0.16, 0.15, 0.15),
                (0.12, low + 0.16, 0.16, 0.15),
                (0.2, low + 0.15, 0.13, 0.1),
            ],
            0.5,
            12,
        ),
    )
    build.add(STEEL, along_x(cylinder(0.1, 0.36, (0, -0.18, 0), 14)).moved(0, low + 0.17, 0.02))
    leans = (-28.0, 28.0) if style == "cruiser" else ((18.0,) if style == "dirt" else (22.0,))
    wide = 0.17 if style in ("cruiser", "dirt") else 0.32
    for lean in leans:
        for k in range(6):
            size = (wide, 0.022, 0.2 if k < 5 else 0.16)
            fin = box(size, (0, 0.13 + 0.042 * k, 0)).turned("x", -lean).moved(0, low + 0.13, -0.06)
            build.add(bike.engine, fin)
        core = box((wide * 0.82, 0.3, 0.14), (0, 0.22, 0)).turned("x", -lean).moved(0, low + 0.13, -0.06)
        build.add(CHROME if style == "cruiser" else bike.engine, core)
    pivot = (0.1, 0.42 if style != "cruiser" else 0.36, 0.24)
    neck = (0.0, y - 0.08, z + 0.03)
    for path in (
        [neck, (0.12, y - 0.22, -0.15), (0.13, bike.seat - 0.1, 0.15), (0.1, bike.seat - 0.06, 0.55)],
        [
            neck,
            (0.1, low + 0.12, -0.26),
            (0.12, low - 0.01, -0.12),
            (0.12, low + 0.02, 0.16),
            pivot,
            (0.13, bike.seat - 0.1, 0.15),
        ],
    ):
        build.add(bike.frame, tube(smooth_path(path, 3), 0.019, 6).pair())
    axle = (0.11, bike.rear, bike.z_rear)
    build.add(bike.frame, bar(pivot, axle, 0.035, 0.06).pair())
    build.add(STEEL, bar((-0.1, bike.rear, bike.z_rear), (0.1, bike.rear, bike.z_rear), 0.03))
    top = (0.13, bike.seat - 0.1, 0.45)
    if style in ("cruiser", "naked"):
        shock = tube([(0.135, bike.rear + 0.04, bike.z_rear - 0.03), top], 0.03, 8)
        build.add(CHROME, shock.pair())
    else:
        build.add(
            plain((0.7, 0.1, 0.08), "spring") if rng.random() < 0.3 else STEEL,
            bar((0, 0.45, 0.28), (0, bike.seat - 0.15, 0.25), 0.07),
        )
    peg_z = -0.25 if style == "cruiser" else 0.2
    build.add(RUBBER, along_x(cylinder(0.014, 0.12, (0, 0.16, 0), 6)).moved(0, 0.34, peg_z).pair())
    build.add(BLACK, bar((-0.12, 0.3, 0.05), (-0.24, 0.03, 0.15), 0.02))


def _exhaust(build: Builder, bike: Chassis, rng: Generator, style: str) -> None:
    """On the own right side."""
    pipe = CHROME if style == "cruiser" or rng.random() < 0.4 else STEEL
    can = pipe if style == "cruiser" or rng.random() < 0.4 else BLACK
    z1 = bike.z_rear
    if style == "dirt":
        path = [
            (0.05, 0.62, -0.22),
            (0.12, 0.58, -0.3),
            (0.16, 0.5, -0.2),
            (0.15, 0.62, 0.1),
            (0.15, 0.74, 0.3),
        ]
        ends = ((0.15, 0.74, 0.3), (0.16, 0.82, z1 - 0.05))
    elif style == "cruiser":
        path = [(0.08, 0.5, -0.2), (0.17, 0.45, -0.26), (0.19, 0.25, -0.1), (0.19, 0.24, 0.3)]
        ends = ((0.19, 0.24, 0.25), (0.19, 0.27, z1 + 0.22))
        build.add(
            pipe, tube(smooth_path([(0.08, 0.5, 0.12), (0.18, 0.42, 0.1), (0.19, 0.34, 0.3)], 4), 0.027, 8)
        )
        build.add(can, tube([(0.19, 0.34, 0.3), (0.19, 0.37, z1 + 0.18)], 0.042, 10))
    else:
        high = rng.random() < 0.5
        path = [
            (0.08, 0.48, -0.24),
            (0.1, 0.38, -0.36),
            (0.13, 0.2, -0.26),
            (0.15, 0.2, 0.2),
            (0.18, 0.28, 0.4),
        ]
        ends = ((0.18, 0.28, 0.38), (0.2, 0.62 if high else 0.36, z1 + (0.0 if high else 0.1)))
        if style == "naked":
            for x in (0.03, -0.03, -0.08):
                bends = [(x, 0.48, -0.24), (x, 0.38, -0.36), (x, 0.2, -0.26), (x, 0.2, 0.1)]
                build.add(pipe, tube(smooth_path(bends, 4), 0.022, 7))
    build.add(pipe, tube(smooth_path(path, 4), 0.026, 8))
    build.add(can, tube(ends, [0.045, 0.058], 12))
    tip = np.array(ends[1])
    build.add(BLACK, tube(np.stack([tip, tip + 0.02 * (tip - ends[0])]), 0.04, 10))
