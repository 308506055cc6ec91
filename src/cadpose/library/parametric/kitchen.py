"""Ovens, microwaves and washing machines; doors and knobs face -z."""

from __future__ import annotations

from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.decals import picture_paint, text_picture
from cadpose.library.parametric.finishes import BLACK, CHROME, DARK_GLASS, STEEL, WHITE
from cadpose.library.parametric.paints import Colour, plain
from cadpose.library.parametric.shapes import bar, box, cylinder, frustum, lathe, rounded_box, torus, tube
from cadpose.library.parametric.solids import Builder, Paint

_ENAMELS: tuple[Colour, ...] = (
    (0.93, 0.93, 0.92),
    (0.93, 0.93, 0.92),
    (0.72, 0.73, 0.75),
    (0.66, 0.67, 0.69),
    (0.09, 0.09, 0.10),
    (0.88, 0.84, 0.74),
    (0.50, 0.10, 0.10),
    (0.30, 0.42, 0.50),
)


def _enamel(rng: Generator) -> Paint:
    return plain(
        _ENAMELS[int(rng.choice(len(_ENAMELS), p=[0.28, 0.12, 0.2, 0.12, 0.16, 0.05, 0.03, 0.04]))], "enamel"
    )


def _is_dark(paint: Paint) -> bool:
    return sum(paint.material.rgba[:3]) < 1.2


def _knob(build: Builder, rng: Generator, paint: Paint, radius: float, x: float, y: float, z: float) -> None:
    build.add(paint, frustum(radius, 0.85 * radius, 0.9 * radius, sides=14).turned("x", -90).moved(x, y, z))
    mark = box((0.25 * radius, 1.7 * radius, 0.3 * radius)).turned("z", float(rng.uniform(-60, 60)))
    build.add(paint, mark.moved(x, y, z - 0.95 * radius))


def _display(build: Builder, rng: Generator, x: float, y: float, z: float, wide: float) -> None:
    ink = [(60, 240, 90), (255, 60, 40), (140, 210, 255), (250, 170, 60)][int(rng.integers(4))]
    text = f"{int(rng.integers(1, 24)):d}:{int(rng.integers(60)):02d}"
    picture = text_picture(64, [(text, 0.5, 0.5, 0.3)], (12, 12, 14), ink)
    build.add(picture_paint(picture, wide, "display"), box((wide, 0.42 * wide, 0.006)).moved(x, y, z))


def _handle(build: Builder, paint: Paint, x0: float, x1: float, y: float, z: float, round_: bool) -> None:
    """A bar across a door on two posts."""
    if round_:
        build.add(paint, bar((x0, y, z - 0.04), (x1, y, z - 0.04), 0.018))
    else:
        build.add(paint, rounded_box((abs(x1 - x0), 0.026, 0.016), ((x0 + x1) / 2, y, z - 0.036), 0.006))
    for x in (x0 + 0.06 * (x1 - x0), x1 - 0.06 * (x1 - x0)):
        build.add(paint, box((0.018, 0.018, 0.04), (x, y, z - 0.018)))


def _door(
    build: Builder, rng: Generator, paint: Paint, frame: tuple[float, float, float, float], z: float
) -> None:
    """An oven's door with window and handle; the frame is (middle x, low y, width, height)."""
    x, low, wide, high = frame
    u = rng.uniform
    glass_door = rng.random() < 0.35
    front = DARK_GLASS if glass_door else paint
    build.add(front, rounded_box((wide, high, 0.04), (x, low + high / 2, z - 0.012), 0.006))
    face = z - 0.033
    inside = plain((0.16, 0.16, 0.17), "window") if (glass_door or _is_dark(paint)) else DARK_GLASS
    w, h = wide * u(0.62, 0.8), high * u(0.42, 0.6)
    y = low + high * u(0.42, 0.47)
    if rng.random() < 0.4:
        build.add(
            STEEL if not glass_door else BLACK, rounded_box((w + 0.02, h + 0.02, 0.006), (x, y, face), 0.003)
        )
    build.add(inside, rounded_box((w, h, 0.008), (x, y, face - 0.001), 0.003))
    if rng.random() < 0.5:
        rack = plain((0.4, 0.4, 0.42), "rack")
        for k in (-0.2, 0.15):
            build.add(rack, box((0.9 * w, 0.005, 0.002), (x, y + k * h, face - 0.006)))
    grip = CHROME if rng.random() < 0.65 else (BLACK if not _is_dark(paint) else STEEL)
    _handle(build, grip, x - 0.4 * wide, x + 0.4 * wide, low + 0.93 * high, face, bool(rng.random() < 0.5))


def oven(rng: Generator) -> Mesh:
    """A stove, a built-in or a table-top oven."""
    build = Builder()
    kind = rng.random()
    if kind < 0.62:
        _stove(build, rng)
    elif kind < 0.85:
        _built_in(build, rng)
    else:
        _table_oven(build, rng)
    return build.mesh("oven")


def _stove(build: Builder, rng: Generator) -> None:
    """Free-standing: hob on top, knobs, oven door, drawer."""
    u = rng.uniform
    paint = _enamel(rng)
    wide = float(rng.choice([0.5, 0.6, 0.6, 0.76, 0.9])) * u(0.98, 1.02)
    high, deep = u(0.85, 0.92), u(0.58, 0.65)
    z = -deep / 2
    build.add(paint, box((wide, high - 0.06, deep), (0, 0.06 + (high - 0.06) / 2, 0)))
    build.add(BLACK, box((wide - 0.06, 0.08, deep - 0.1), (0, 0.04, 0.02)))
    top = high
    ceramic = rng.random() < 0.35
    build.add(
        BLACK if ceramic or rng.random() < 0.4 else paint,
        rounded_box((wide + 0.005, 0.02, deep + 0.01), (0, top, 0), 0.006),
    )
    _hob(build, rng, wide, deep, top + 0.01, ceramic)
    panel_y = top - 0.065
    behind = rng.random() < 0.3
    knob = BLACK if rng.random() < 0.5 and not _is_dark(paint) else (CHROME if rng.random() < 0.6 else STEEL)
    if behind:
        build.add(paint, rounded_box((wide, 0.2, 0.06), (0, top + 0.1, deep / 2 - 0.03), 0.015))
        row, face, rise = top + 0.11, deep / 2 - 0.061, 0.0
    else:
        if rng.random() < 0.3:
            build.add(paint, box((wide, u(0.04, 0.12), 0.025), (0, top + 0.04, deep / 2 - 0.0125)))
        panel = DARK_GLASS if rng.random() < 0.25 else paint
        build.add(panel, rounded_box((wide, 0.11, 0.03), (0, panel_y, z - 0.008), 0.008))
        row, face, rise = panel_y, z - 0.023, 0.11
    count = int(rng.integers(4, 8))
    _display(build, rng, 0.0, row, face - 0.002, 0.12)
    for k in range(count):
        x = (k - (count - 1) / 2) / count * wide * 0.92
        if abs(x) > 0.085:
            _knob(build, rng, knob, u(0.02, 0.021), x, row, face)
    door_top = high - 0.02 - rise
    low = u(0.2, 0.3)
    if wide > 0.85:
        half = wide / 2 - 0.012
        for x in (-0.25, 0.25):
            _door(build, rng, paint, (x * wide, 0.1, half, door_top - 0.11), z)
        return
    _door(build, rng, paint, (0.0, low, wide - 0.016, door_top - low), z)
    build.add(
        paint, rounded_box((wide - 0.016, low - 0.09, 0.035), (0, 0.08 + (low - 0.09) / 2, z - 0.01), 0.006)
    )
    if rng.random() < 0.5:
        _handle(build, knob, -0.25 * wide, 0.25 * wide, low - 0.05, z - 0.027, True)


def _hob(build: Builder, rng: Generator, wide: float, deep: float, y: float, ceramic: bool) -> None:
    """Burners with grates, or rings on black glass."""
    spots = [(-0.24, -0.22, 0.085), (0.24, -0.22, 0.1), (-0.24, 0.22, 0.1), (0.24, 0.22, 0.075)]
    if wide > 0.7:
        spots.append((0.0, 0.0, 0.11))
    if ceramic:
        for x, z, r in spots:
            for share in (1.0, 0.55):
                ring = torus(share * r, 0.004, sides=24, around=4).scaled(y=0.3)
                build.add(plain((0.62, 0.62, 0.64), "ring"), ring.moved(x * wide, y, z * deep))
        return
    electric = rng.random() < 0.2
    for x, z, r in spots:
        at = (x * wide, y, z * deep)
        if electric:
            build.add(
                plain((0.15, 0.15, 0.16), "plate"),
                lathe([(r, 0), (r, 0.012), (0.9 * r, 0.015), (0.2 * r, 0.012)], 20, at),
            )
            build.add(STEEL, torus(r, 0.006, sides=20, around=4).moved(*at))
            continue
        build.add(STEEL, cylinder(0.55 * r, 0.008, at, 16))
        build.add(BLACK, cylinder(0.4 * r, 0.02, at, 16))
        for turn in range(4):
            arm = box((0.06, 0.01, 0.012), (0.06, 0.036, 0)).turned("y", 90.0 * turn)
            foot = box((0.012, 0.036, 0.012), (0.088, 0.018, 0)).turned("y", 90.0 * turn)
            build.add(BLACK, arm.moved(*at), foot.moved(*at))
    if not electric:
        for x in (-0.24, 0.24):
            size = (0.44 * wide, 0.92 * deep)
            for sign in (-0.5, 0.5):
                build.add(BLACK, box((size[0], 0.01, 0.012), (x * wide, y + 0.036, sign * size[1] * 0.95)))
                build.add(
                    BLACK, box((0.012, 0.01, size[1] * 0.95), (x * wide + sign * size[0], y + 0.036, 0))
                )


def _built_in(build: Builder, rng: Generator) -> None:
    u = rng.uniform
    paint = _enamel(rng)
    wide, deep = u(0.58, 0.62), u(0.5, 0.58)
    double = rng.random() < 0.25
    high = u(0.56, 0.62) if not double else u(1.1, 1.3)
    z = -deep / 2
    build.add(
        plain((0.45, 0.47, 0.46), "casing"), box((wide - 0.04, high - 0.02, deep - 0.02), (0, high / 2, 0.01))
    )
    build.add(paint, box((wide, high, 0.02), (0, high / 2, z + 0.01)))
    panel = 0.11
    face = z - 0.014
    build.add(
        DARK_GLASS if rng.random() < 0.5 else paint,
        rounded_box((wide, panel, 0.024), (0, high - panel / 2, z - 0.003), 0.004),
    )
    _display(build, rng, 0.0, high - panel / 2, face - 0.003, 0.13)
    knob = CHROME if rng.random() < 0.6 else (BLACK if not _is_dark(paint) else STEEL)
    for x in [(-0.2, 0.2), (-0.32, -0.18, 0.18, 0.32), (0.3,)][int(rng.integers(3))]:
        _knob(build, rng, knob, 0.021, x * wide * 1.2, high - panel / 2, face)
    body = high - panel - 0.02
    if double:
        _door(build, rng, paint, (0.0, 0.01, wide - 0.006, body * 0.52), z)
        _door(build, rng, paint, (0.0, 0.02 + body * 0.52, wide - 0.006, body * 0.46), z)
    else:
        _door(build, rng, paint, (0.0, 0.01, wide - 0.006, body), z)


def _table_oven(build: Builder, rng: Generator) -> None:
    """A toaster oven: window at the own right, knobs at the own left."""
    u = rng.uniform
    paint = _enamel(rng)
    wide, high, deep = u(0.4, 0.5), u(0.23, 0.3), u(0.28, 0.36)
    z = -deep / 2
    build.add(paint, rounded_box((wide, high, deep), (0, high / 2 + 0.015, 0), 0.015))
    for x in (-0.42, 0.42):
        for back in (-0.4, 0.4):
            build.add(BLACK, cylinder(0.012, 0.018, (x * wide, 0, back * deep), 10))
    middle = high / 2 + 0.015
    window = 0.68 * wide
    at = wide / 2 - window / 2 - 0.02
    build.add(
        STEEL if _is_dark(paint) else plain((0.2, 0.2, 0.21), "frame"),
        rounded_box((window, 0.8 * high, 0.02), (at, middle, z - 0.004), 0.006),
    )
    build.add(DARK_GLASS, box((window - 0.035, 0.62 * high, 0.01), (at, middle - 0.01, z - 0.012)))
    for k in (-0.12, 0.1):
        build.add(STEEL, box((window - 0.05, 0.003, 0.003), (at, middle + k * high, z - 0.018)))
    _handle(
        build,
        CHROME if rng.random() < 0.5 else BLACK,
        at - 0.4 * window,
        at + 0.4 * window,
        middle + 0.35 * high,
        z - 0.012,
        True,
    )
    for k in range(3):
        _knob(
            build,
            rng,
            BLACK if not _is_dark(paint) else CHROME,
            0.02,
            -wide / 2 + 0.055,
            middle + (k - 1) * 0.28 * high,
            z,
        )


def microwave(rng: Generator) -> Mesh:
    """A microwave: window at the own right, panel at the own left."""
    u = rng.uniform
    build = Builder()
    paint = _enamel(rng)
    wide, high, deep = u(0.44, 0.54), u(0.26, 0.31), u(0.32, 0.42)
    z = -deep / 2
    build.add(paint, rounded_box((wide, high, deep), (0, high / 2 + 0.01, 0), 0.008))
    middle = high / 2 + 0.01
    panel = u(0.2, 0.28) * wide
    door = wide - panel
    at = wide / 2 - door / 2
    trim = DARK_GLASS if rng.random() < 0.5 else paint
    build.add(trim, rounded_box((door - 0.004, high - 0.01, 0.022), (at, middle, z - 0.006), 0.006))
    build.add(
        paint if rng.random() < 0.5 else BLACK,
        rounded_box((panel - 0.004, high - 0.01, 0.022), (-wide / 2 + panel / 2, middle, z - 0.006), 0.006),
    )
    window = plain((0.15, 0.15, 0.16), "window") if trim is DARK_GLASS else DARK_GLASS
    build.add(
        window, rounded_box((0.72 * door, 0.62 * high, 0.008), (at + 0.02 * wide, middle, z - 0.016), 0.004)
    )
    x = -wide / 2 + panel / 2
    _display(build, rng, x, middle + 0.34 * high, z - 0.018, 0.72 * panel)
    if rng.random() < 0.55:
        key = plain((0.55, 0.55, 0.57), "keys") if rng.random() < 0.6 else WHITE
        for row in range(5):
            for column in (-1, 0, 1):
                size = (0.2 * panel, 0.07 * high, 0.008)
                build.add(
                    key, box(size, (x + column * 0.26 * panel, middle + (0.15 - 0.1 * row) * high, z - 0.018))
                )
    else:
        for y in (0.08, -0.22):
            _knob(
                build,
                rng,
                STEEL if rng.random() < 0.5 else BLACK,
                0.24 * panel,
                x,
                middle + y * high,
                z - 0.016,
            )
    if rng.random() < 0.6:
        edge = -wide / 2 + panel + 0.025
        build.add(
            CHROME if rng.random() < 0.6 else BLACK,
            tube(
                [
                    (edge, middle - 0.34 * high, z - 0.01),
                    (edge, middle - 0.3 * high, z - 0.045),
                    (edge, middle + 0.3 * high, z - 0.045),
                    (edge, middle + 0.34 * high, z - 0.01),
                ],
                0.008,
                8,
            ),
        )
    for side in (-0.42, 0.42):
        for back in (-0.4, 0.4):
            build.add(BLACK, cylinder(0.012, 0.014, (side * wide, 0, back * deep), 10))
    for k in range(5):
        build.add(
            BLACK, box((0.004, 0.008, 0.4 * deep), (wide / 2, middle + (0.05 * k) * high, 0.12 * deep)).pair()
        )
    return build.mesh("microwave")


def washing_machine(rng: Generator) -> Mesh:
    """A front loader: round door, drawer at the own right, knob and display above."""
    u = rng.uniform
    build = Builder()
    paint = plain(
        [(0.94, 0.94, 0.94), (0.94, 0.94, 0.94), (0.62, 0.63, 0.65), (0.2, 0.2, 0.22)][int(rng.integers(4))],
        "enamel",
    )
    wide, high, deep = u(0.58, 0.62), u(0.82, 0.9), u(0.5, 0.62)
    z = -deep / 2
    build.add(paint, rounded_box((wide, high, deep), (0, high / 2, 0), 0.01))
    build.add(paint, rounded_box((wide + 0.004, 0.03, deep + 0.012), (0, high - 0.012, 0), 0.006))
    row = high - 0.09
    build.add(
        DARK_GLASS if rng.random() < 0.25 else paint,
        rounded_box((wide - 0.01, 0.11, 0.02), (0, row, z - 0.004), 0.006),
    )
    build.add(paint, rounded_box((0.19, 0.09, 0.024), (wide / 2 - 0.11, row, z - 0.008), 0.006))
    build.add(BLACK, box((0.1, 0.012, 0.01), (wide / 2 - 0.11, row - 0.03, z - 0.018)))
    knob = CHROME if rng.random() < 0.5 else (WHITE if rng.random() < 0.5 else STEEL)
    _knob(build, rng, knob, u(0.028, 0.036), u(-0.05, 0.02), row, z - 0.014)
    _display(build, rng, -wide / 2 + 0.14, row + 0.01, z - 0.014, 0.11)
    for k in range(4):
        build.add(
            STEEL,
            cylinder(0.008, 0.008, sides=10)
            .turned("x", -90)
            .moved(-wide / 2 + 0.08 + 0.04 * k, row - 0.033, z - 0.014),
        )
    r, y = u(0.15, 0.19), high * u(0.46, 0.5)
    rim = CHROME if rng.random() < 0.45 else (WHITE if rng.random() < 0.6 else plain((0.2, 0.2, 0.22), "rim"))
    build.add(
        rim,
        lathe([(1.2 * r, 0.0), (1.2 * r, 0.015), (1.1 * r, 0.035), (0.9 * r, 0.035)], 36)
        .turned("x", -90)
        .moved(0, y, z),
    )
    glass = plain((0.14, 0.16, 0.19), "door glass")
    build.add(
        glass,
        lathe([(0.9 * r, 0.0), (0.9 * r, 0.04), (0.7 * r, 0.055), (0.3 * r, 0.062)], 32)
        .turned("x", -90)
        .moved(0, y, z),
    )
    build.add(
        plain((0.32, 0.34, 0.37), "drum"),
        torus(0.62 * r, 0.012, sides=28, around=5).turned("x", 90).moved(0, y, z - 0.056),
    )
    build.add(
        BLACK if rim is not BLACK else CHROME,
        rounded_box((0.03, 0.1, 0.02), (-1.06 * r, y, z - 0.036), 0.008),
    )
    build.add(paint, box((wide - 0.02, 0.004, 0.012), (0, 0.12, z - 0.001)))
    build.add(plain((0.5, 0.5, 0.52), "gap"), box((wide - 0.01, 0.005, 0.006), (0, 0.115, z)))
    build.add(STEEL, box((0.1, 0.06, 0.008), (-wide / 2 + 0.09, 0.06, z)))
    for x in (-0.42, 0.42):
        for back in (-0.4, 0.4):
            build.add(BLACK, cylinder(0.02, 0.02, (x * wide, -0.015, back * deep), 10))
    return build.mesh("washing machine")
