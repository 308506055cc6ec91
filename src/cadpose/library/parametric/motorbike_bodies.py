"""What makes the style of a motorbike: tank, seat, fairing, mudguards, lamps."""

from __future__ import annotations

from dataclasses import dataclass

from numpy.random import Generator

from cadpose.library.parametric.decals import number_plate
from cadpose.library.parametric.finishes import AMBER, BLACK, CHROME, LENS, RED_LIGHT
from cadpose.library.parametric.hulls import hull, mudguard, side_panel, tower
from cadpose.library.parametric.paints import Colour, plain
from cadpose.library.parametric.shapes import bar, box, cylinder, ellipsoid, rounded_box, torus, tube
from cadpose.library.parametric.solids import Builder, Paint
from cadpose.library.parametric.wheels import along_x

COLOURS: tuple[Colour, ...] = ((0.75, 0.06, 0.06), (0.08, 0.08, 0.09), (0.10, 0.22, 0.60), (0.92, 0.92,
    0.92), (0.15, 0.55, 0.20), (0.92, 0.45, 0.05), (0.93, 0.78, 0.10), (0.45, 0.47, 0.50), (0.40, 0.06,
    0.10), (0.55, 0.72, 0.70), (0.85, 0.80, 0.66), (0.07, 0.12, 0.25))  # fmt: skip


@dataclass(frozen=True)
class Chassis:
    """Measures and looks: wheel radii, axles' z, height of the seat, steering head and looks."""

    front: float
    rear: float
    z_front: float
    z_rear: float
    seat: float
    head: tuple[float, float]  # y, z of the top of the fork
    paint: Paint
    frame: Paint
    engine: Paint
    leather: Paint
    rim: Paint


def add_body(build: Builder, bike: Chassis, rng: Generator, style: str) -> None:
    """Everything above wheels, fork and engine, of a style of `motorbike.STYLES`."""
    bodies = {"naked": _naked, "sport": _sport, "cruiser": _cruiser, "scooter": _scooter, "dirt": _dirt}
    bodies[style](build, bike, rng)


def _headlight(build: Builder, bike: Chassis, radius: float, shell: Paint) -> None:
    y, z = bike.head
    y, z = y - 0.1, z - 0.13
    build.add(shell, ellipsoid((radius, radius, 0.11), (0, y, z + 0.03), 14))
    build.add(LENS, cylinder(radius * 0.92, 0.03, sides=16).turned("x", -90).moved(0, y, z + 0.02))
    build.add(CHROME, torus(radius * 0.95, 0.012, sides=16, around=5).turned("x", 90).moved(0, y, z))


def _tail(build: Builder, bike: Chassis, rng: Generator, y: float, z: float) -> None:
    """Light and plate at +z, with a holder."""
    build.add(RED_LIGHT, rounded_box((0.14, 0.06, 0.05), (0, y, z), 0.02))
    build.add(BLACK, bar((0, y - 0.02, z - 0.06), (0, y - 0.22, z + 0.05), 0.1, 0.012))
    paint, solid = number_plate(rng, (0, 0, 0), to_front=False, width=0.2)
    build.add(paint, solid.moved(0, y - 0.16, z + 0.06))


def _naked(build: Builder, bike: Chassis, rng: Generator) -> None:
    s, front, (y, z) = bike.seat, bike.front, bike.head
    build.add(bike.paint, hull([(z + 0.02, y - 0.04, 0.06, 0.04), (z + 0.1, y - 0.02, 0.13,
        0.09), (-0.1, s + 0.09, 0.155, 0.11), (0.05, s + 0.04, 0.12, 0.08), (0.14, s - 0.01,
        0.09, 0.04)], 0.75, 14))  # fmt: skip
    build.add(bike.leather, hull([(0.08, s, 0.08, 0.035), (0.15, s, 0.12, 0.04), (0.4, s + 0.02,
        0.13, 0.045), (0.5, s + 0.05, 0.12, 0.045), (bike.z_rear + 0.02, s + 0.06, 0.08, 0.03)],
        0.6, 12))  # fmt: skip
    build.add(
        bike.paint,
        hull(
            [
                (0.25, s - 0.07, 0.13, 0.05),
                (0.5, s - 0.03, 0.12, 0.05),
                (bike.z_rear + 0.1, s + 0.02, 0.06, 0.03),
            ],
            0.6,
            12,
        ),
    )
    build.add(
        bike.paint if rng.random() < 0.6 else BLACK,
        side_panel([(0.1, s - 0.06), (0.36, s - 0.06), (0.3, s - 0.26), (0.14, s - 0.22)], 0.13, 0.03),
    )
    build.add(bike.paint, mudguard(front + 0.035, 0.14, 40, 150, (0, front, bike.z_front)))
    build.add(BLACK, mudguard(bike.rear + 0.05, 0.17, 70, 160, (0, bike.rear, bike.z_rear)))
    _headlight(build, bike, float(rng.uniform(0.085, 0.105)), CHROME if rng.random() < 0.4 else BLACK)
    for x in (0.05, -0.05):
        build.add(BLACK, cylinder(0.045, 0.05, sides=10).turned("x", 60).moved(x, y + 0.05, z - 0.03))
    _tail(build, bike, rng, s, bike.z_rear + 0.12)


def _sport(build: Builder, bike: Chassis, rng: Generator) -> None:
    s, front, (y, z) = bike.seat, bike.front, bike.head
    nose = bike.z_front + 0.03
    second = plain(COLOURS[int(rng.integers(len(COLOURS)))], "second") if rng.random() < 0.5 else bike.paint
    build.add(bike.paint, hull([(nose - 0.06, y - 0.14, 0.04, 0.03), (nose, y - 0.1, 0.13, 0.09), (nose +
        0.12, y - 0.06, 0.2, 0.14), (nose + 0.28, y - 0.06, 0.22, 0.16)], 0.75, 14))  # fmt: skip
    build.add(plain((0.16, 0.18, 0.2), "screen", 0.75), hull([(nose + 0.02, y - 0.02, 0.06, 0.02), (nose +
        0.14, y + 0.06, 0.12, 0.06), (nose + 0.3, y + 0.12, 0.13, 0.09)], 0.9, 12))  # fmt: skip
    tilt = rng.uniform(8, 28)
    lens = (
        rounded_box((0.13, 0.06, 0.07), (0, 0, 0), 0.02).turned("z", tilt).moved(0.085, y - 0.1, nose - 0.02)
    )
    build.add(LENS, lens.pair())
    build.add(BLACK, box((0.1, 0.05, 0.03), (0, y - 0.18, nose - 0.01)))
    flank = [(nose + 0.08, y - 0.02), (nose + 0.3, y + 0.02), (0.02, s - 0.12), (0.12, 0.42), (0.16, 0.24),
        (-0.25, 0.2), (nose + 0.28, 0.45), (nose + 0.16, 0.62)]  # fmt: skip
    build.add(bike.paint, side_panel(flank, 0.205, 0.03, (0.06, 0.06)))
    stripe = [(nose + 0.2, 0.62), (0.06, 0.46), (0.13, 0.24), (-0.24, 0.2), (nose + 0.3, 0.45)]
    build.add(second, side_panel(stripe, 0.213, 0.03, (0.07, 0.06)))
    build.add(
        BLACK, hull([(-0.3, 0.22, 0.1, 0.05), (0.1, 0.2, 0.13, 0.06), (0.22, 0.22, 0.1, 0.04)], 0.6, 10)
    )
    build.add(bike.paint, hull([(z + 0.04, y - 0.06, 0.1, 0.05), (z + 0.14, y - 0.02, 0.16,
        0.11), (-0.08, s + 0.09, 0.165, 0.12), (0.08, s + 0.02, 0.11, 0.07), (0.14, s - 0.02,
        0.08, 0.04)], 0.75, 14))  # fmt: skip
    build.add(
        bike.leather,
        hull(
            [(0.08, s - 0.02, 0.08, 0.03), (0.16, s - 0.01, 0.14, 0.035), (0.36, s + 0.02, 0.13, 0.04)],
            0.6,
            12,
        ),
    )
    build.add(
        bike.leather,
        hull(
            [(0.36, s + 0.09, 0.1, 0.04), (0.5, s + 0.11, 0.1, 0.04), (0.62, s + 0.13, 0.06, 0.03)], 0.6, 12
        ),
    )
    build.add(bike.paint, hull([(0.16, s - 0.08, 0.14, 0.05), (0.4, s + 0.02, 0.13, 0.07), (0.6, s + 0.08,
        0.1, 0.06), (bike.z_rear + 0.12, s + 0.12, 0.05, 0.03)], 0.65, 12))  # fmt: skip
    build.add(second, mudguard(front + 0.03, 0.13, 30, 150, (0, front, bike.z_front)))
    build.add(BLACK, mudguard(bike.rear + 0.04, 0.18, 60, 130, (0, bike.rear, bike.z_rear)))
    _tail(build, bike, rng, s + 0.08, bike.z_rear + 0.11)


def _cruiser(build: Builder, bike: Chassis, rng: Generator) -> None:
    s, front, (y, z) = bike.seat, bike.front, bike.head
    build.add(bike.paint, hull([(z + 0.06, y - 0.07, 0.07, 0.05), (z + 0.14, y - 0.08, 0.14, 0.09), (-0.14, s
        + 0.1, 0.165, 0.1), (0.04, s + 0.05, 0.11, 0.06), (0.16, s, 0.04, 0.02)], 0.9, 14))  # fmt: skip
    build.add(
        bike.leather,
        hull(
            [
                (0.05, s, 0.08, 0.04),
                (0.16, s - 0.01, 0.15, 0.05),
                (0.38, s + 0.01, 0.18, 0.055),
                (0.46, s + 0.07, 0.14, 0.05),
            ],
            0.7,
            12,
        ),
    )
    build.add(
        bike.leather,
        hull(
            [
                (0.44, s + 0.09, 0.1, 0.04),
                (0.6, s + 0.1, 0.12, 0.045),
                (bike.z_rear - 0.02, s + 0.1, 0.08, 0.03),
            ],
            0.7,
            12,
        ),
    )
    build.add(bike.paint, mudguard(front + 0.05, 0.17, 10, 175, (0, front, bike.z_front), 12))
    build.add(bike.paint, mudguard(bike.rear + 0.08, 0.24, 60, 190, (0, bike.rear, bike.z_rear), 12))
    build.add(
        bike.paint,
        side_panel([(0.12, s - 0.06), (0.34, s - 0.06), (0.3, s - 0.22), (0.16, s - 0.22)], 0.13, 0.03),
    )
    _headlight(build, bike, float(rng.uniform(0.10, 0.125)), CHROME)
    build.add(CHROME, along_x(cylinder(0.09, 0.05, (0, 0.14, 0), 14)).moved(0, 0.52, -0.04))
    if rng.random() < 0.4:
        bag = rounded_box((0.15, 0.26, 0.36), (0.22, 0.5, bike.z_rear - 0.02), 0.05)
        build.add(bike.leather, bag.pair())
    if rng.random() < 0.4:
        build.add(
            plain((0.75, 0.82, 0.85), "screen", 0.4),
            hull([(z - 0.13, y + 0.02, 0.16, 0.1), (z - 0.02, y + 0.22, 0.2, 0.24)], 0.8, 12).scaled(z=1.0),
        )
    if rng.random() < 0.35:
        build.add(
            CHROME,
            tube([(0.11, s, 0.62), (0.1, s + 0.3, 0.75), (-0.1, s + 0.3, 0.75), (-0.11, s, 0.62)], 0.012, 6),
        )
    _tail(build, bike, rng, bike.rear + 0.3, bike.z_rear + bike.rear * 0.75)


def _dirt(build: Builder, bike: Chassis, rng: Generator) -> None:
    s, (y, z) = bike.seat, bike.head
    white = plain((0.9, 0.9, 0.9), "panel")
    build.add(
        bike.paint,
        hull(
            [(z + 0.04, y - 0.1, 0.06, 0.05), (-0.18, s + 0.02, 0.11, 0.09), (-0.02, s - 0.02, 0.09, 0.05)],
            0.7,
            12,
        ),
    )
    shroud = [
        (z - 0.06, y - 0.2),
        (z + 0.06, y - 0.06),
        (-0.05, s - 0.02),
        (-0.08, s - 0.12),
        (-0.3, s - 0.4),
    ]
    build.add(bike.paint, side_panel(shroud, 0.14, 0.025, (-0.06, 0.0)))
    build.add(
        bike.leather,
        hull(
            [
                (-0.16, s + 0.08, 0.05, 0.03),
                (0.0, s + 0.02, 0.08, 0.04),
                (0.3, s, 0.09, 0.045),
                (0.58, s + 0.04, 0.08, 0.03),
            ],
            0.6,
            12,
        ),
    )
    tail = [
        (0.45, s - 0.01, 0.08, 0.015),
        (bike.z_rear, s + 0.02, 0.085, 0.012),
        (bike.z_rear + 0.28, s + 0.07, 0.05, 0.008),
    ]
    build.add(bike.paint, hull(tail, 0.5, 10))
    beak_y = bike.front * 2 + 0.1
    beak = [
        (bike.z_front - 0.32, beak_y - 0.02, 0.04, 0.008),
        (bike.z_front - 0.1, beak_y + 0.02, 0.085, 0.014),
        (bike.z_front + 0.12, beak_y, 0.09, 0.014),
        (bike.z_front + 0.36, beak_y - 0.08, 0.06, 0.01),
    ]
    build.add(bike.paint, hull(beak, 0.5, 10))
    build.add(
        white if rng.random() < 0.5 else bike.paint,
        side_panel([(0.08, s - 0.08), (0.5, s - 0.04), (0.4, s - 0.28), (0.2, s - 0.24)], 0.12, 0.025),
    )
    mask = tower(
        [
            (y - 0.22, z - 0.12, 0.06, 0.02),
            (y - 0.12, z - 0.12, 0.11, 0.03),
            (y + 0.06, z - 0.06, 0.09, 0.02),
        ],
        0.6,
        12,
    )
    build.add(bike.paint if rng.random() < 0.5 else white, mask)
    build.add(LENS, rounded_box((0.12, 0.08, 0.04), (0, y - 0.12, z - 0.145), 0.02))
    _tail(build, bike, rng, s + 0.02, bike.z_rear + 0.24)


def _scooter(build: Builder, bike: Chassis, rng: Generator) -> None:
    u = rng.uniform
    s, front, (y, z) = bike.seat, bike.front, bike.head
    retro = rng.random() < 0.5
    grey = plain((0.3, 0.3, 0.31), "plastic")
    wide = u(0.19, 0.24)
    build.add(
        bike.paint,
        tower(
            [
                (0.3, z - 0.02, 0.6 * wide, 0.05),
                (0.45, z - 0.04, wide, 0.06),
                (0.7, z - 0.02, wide * 0.92, 0.05),
                (y - 0.06, z, 0.45 * wide, 0.06),
            ],
            0.75,
        ),
    )
    build.add(
        grey,
        tower(
            [
                (0.3, z + 0.03, 0.55 * wide, 0.05),
                (0.5, z + 0.03, 0.9 * wide, 0.05),
                (y - 0.08, z + 0.04, 0.4 * wide, 0.05),
            ],
            0.75,
        ),
    )
    build.add(grey, rounded_box((0.36, 0.07, 0.52), (0, 0.28, z + 0.27), 0.03))
    build.add(bike.paint, rounded_box((0.38, 0.05, 0.56), (0, 0.24, z + 0.29), 0.02))
    start = z + 0.46
    end = bike.z_rear + u(0.18, 0.26)
    build.add(bike.paint, hull([(start, 0.5, 0.13, 0.22), (start + 0.08, 0.52, 0.17, 0.25), (0.4 * start +
        0.6 * end, 0.58, u(0.18, 0.23), 0.2), (end - 0.08, 0.62, 0.13, 0.12), (end, 0.64, 0.06, 0.05)], 0.75,
        14))  # fmt: skip
    if retro:
        build.add(bike.paint, ellipsoid((0.1, 0.16, 0.3), (0.16, 0.5, 0.35 * start + 0.65 * end), 14).pair())
    build.add(bike.leather, hull([(start + 0.02, s - 0.03, 0.08, 0.03), (start + 0.12, s - 0.01, 0.14, 0.05),
        (start + 0.42, s + 0.01, 0.15, 0.05), (start + 0.5, s + 0.04, 0.13, 0.05), (end - 0.06, s + 0.04,
        0.08, 0.03)], 0.65, 12))  # fmt: skip
    build.add(bike.paint, mudguard(front + 0.045, 0.17, 5, 170, (0, front, bike.z_front), 11))
    build.add(BLACK, mudguard(bike.rear + 0.05, 0.16, 70, 170, (0, bike.rear, bike.z_rear)))
    build.add(BLACK, rounded_box((0.3, 0.16, 0.34), (0, 0.26, bike.z_rear - 0.12), 0.05))
    build.add(
        BLACK, tube([(0.15, 0.26, bike.z_rear - 0.2), (0.16, 0.3, bike.z_rear + 0.2)], [0.05, 0.065], 10)
    )
    build.add(bike.paint, ellipsoid((0.14, 0.075, 0.1), (0, y + 0.04, z - 0.03), 14))
    lamp_y = y + 0.045 if retro or rng.random() < 0.5 else y - 0.22
    lamp_z = z - 0.11 if lamp_y > y else z - 0.1
    if retro:
        build.add(LENS, cylinder(0.075, 0.05, sides=16).turned("x", -90).moved(0, lamp_y, lamp_z + 0.03))
        build.add(
            CHROME, torus(0.075, 0.01, sides=16, around=5).turned("x", 90).moved(0, lamp_y, lamp_z - 0.015)
        )
    else:
        lens = rounded_box((0.13, 0.06, 0.06), (0, 0, 0), 0.025).turned("z", 18)
        build.add(LENS, lens.moved(0.08, lamp_y, lamp_z).pair())
    build.add(AMBER, ellipsoid((0.035, 0.022, 0.02), (0.7 * wide, 0.62, z - 0.065), 8).pair())
    if rng.random() < 0.35:
        build.add(BLACK, rounded_box((0.36, 0.28, 0.34), (0, s + 0.18, end + 0.02), 0.06))
    else:
        rail = [
            (0.11, s - 0.02, end - 0.2),
            (0.11, s + 0.04, end + 0.02),
            (-0.11, s + 0.04, end + 0.02),
            (-0.11, s - 0.02, end - 0.2),
        ]
        build.add(CHROME, tube(rail, 0.012, 6))
    build.add(RED_LIGHT, rounded_box((0.16, 0.07, 0.05), (0, 0.66, end - 0.01), 0.02))
    paint, solid = number_plate(rng, (0, 0, 0), to_front=False, width=0.2)
    build.add(BLACK, box((0.16, 0.26, 0.015), (0, 0.46, end + 0.0)))
    build.add(paint, solid.moved(0, 0.44, end + 0.02))
