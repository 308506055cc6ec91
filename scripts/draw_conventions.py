"""Draws the figures of docs/conventions.md as SVG, with the project's own geometry and nothing else.

python scripts/draw_conventions.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from cadpose.alignment.focal import focal_from_box
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras, projected_rectangle
from cadpose.geometry.frames import FloatArray

INK, GREY, FAINT = "#222222", "#777777", "#c8c8c8"
RED, GREEN, BLUE, VIOLET = "#c62828", "#2e7d32", "#1565c0", "#6a1b9a"
# The toy car's sides: front and back, own left and own right, top and bottom.
PAINT = {
    "front": "#ffb74d",
    "back": "#9e9e9e",
    "left": "#80cbc4",
    "right": "#b39ddb",
    "top": "#eceff1",
    "under": "#607d8b",
}
HALF = {"x": 0.19, "z": 0.42}
# Where body and cabin meet; so high that the origin is the middle of the bounding box.
WAIST = 0.0375


class Svg:
    """A list of SVG elements on a white sheet."""

    def __init__(self, width: float, height: float, title: str) -> None:
        self.head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:g} {height:g}" width="{width:g}" '
            f'height="{height:g}" role="img" font-family="Helvetica, Arial, sans-serif">\n'
            f"<title>{title}</title>\n"
            f'<rect width="{width:g}" height="{height:g}" fill="#ffffff"/>'
        )
        self.items: list[str] = []

    def polygon(self, points: FloatArray, fill: str, stroke: str = INK, width: float = 1.0) -> None:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        self.items.append(
            f'<polygon points="{path}" fill="{fill}" stroke="{stroke}" stroke-width="{width:g}" '
            'stroke-linejoin="round"/>'
        )

    def line(self, points: FloatArray, colour: str = INK, width: float = 1.5, dash: str = "") -> None:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
        dashed = f' stroke-dasharray="{dash}"' if dash else ""
        self.items.append(
            f'<polyline points="{path}" fill="none" stroke="{colour}" stroke-width="{width:g}"{dashed}/>'
        )

    def arrow(self, points: FloatArray, colour: str = INK, width: float = 2.0, head: float = 9.0) -> None:
        points = np.asarray(points, np.float64)
        tip, way = points[-1], points[-1] - points[-2]
        way = way / np.linalg.norm(way)
        side = np.array([-way[1], way[0]])
        self.line(np.vstack([points[:-1], tip - way * head * 0.7]), colour, width)
        self.polygon(
            np.array([tip, tip - way * head + side * head * 0.4, tip - way * head - side * head * 0.4]),
            colour,
            colour,
        )

    def dot(self, point: FloatArray, colour: str = INK, radius: float = 3.0) -> None:
        self.items.append(f'<circle cx="{point[0]:.1f}" cy="{point[1]:.1f}" r="{radius:g}" fill="{colour}"/>')

    def text(
        self,
        x: float,
        y: float,
        text: str,
        colour: str = INK,
        size: float = 13,
        anchor: str = "start",
        bold: bool = False,
    ) -> None:
        weight = ' font-weight="bold"' if bold else ""
        self.items.append(
            f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" font-size="{size:g}" '
            f'text-anchor="{anchor}"{weight}>{text}</text>'
        )

    def write(self, path: Path) -> None:
        path.write_text("\n".join([self.head, *self.items, "</svg>", ""]), encoding="utf-8")


def _rectangle(axis: int, at: float, low: tuple[float, float], high: tuple[float, float]) -> FloatArray:
    """Four corners of a rectangle on the plane where coordinate ``axis`` is ``at``."""
    (a0, b0), (a1, b1) = low, high
    return np.insert(np.array([[a0, b0], [a1, b0], [a1, b1], [a0, b1]]), axis, at, axis=1)


def _disc(x: float, y: float, z: float, radius: float) -> FloatArray:
    turn = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    return np.stack([np.full(24, x), y + radius * np.cos(turn), z + radius * np.sin(turn)], axis=-1)


def _block(low: FloatArray, high: FloatArray, inset: float, rise: float) -> list[tuple[str, FloatArray]]:
    """Six faces by name; the top is smaller by ``inset`` sideways and ``rise`` lengthwise."""
    (x0, y0, z0), (x1, y1, z1) = low, high
    bottom = np.array([[x0, y0, z0], [x1, y0, z0], [x1, y0, z1], [x0, y0, z1]])
    top = np.array(
        [
            [x0 + inset, y1, z0 + 2 * rise],
            [x1 - inset, y1, z0 + 2 * rise],
            [x1 - inset, y1, z1 - rise],
            [x0 + inset, y1, z1 - rise],
        ]
    )
    names = ["front", "right", "back", "left"]
    sides = [
        (names[i], np.array([bottom[i], bottom[(i + 1) % 4], top[(i + 1) % 4], top[i]])) for i in range(4)
    ]
    return [*sides, ("top", top), ("under", bottom)]


def toy_car() -> list[tuple[list[tuple[str, FloatArray]], list[tuple[str, str, FloatArray]]]]:
    """A car in ShapeNet axes (y up, front -z, own right +x): body and cabin with what is painted on."""
    x, z, waist = HALF["x"], HALF["z"], WAIST
    body = _block(np.array([-x, waist - 0.15, -z]), np.array([x, waist, z]), 0.0, 0.0)
    cabin = _block(np.array([-x + 0.01, waist, -0.16]), np.array([x - 0.01, waist + 0.13, 0.34]), 0.04, 0.06)
    painted: list[tuple[str, str, FloatArray]] = []
    for side in (-1, 1):
        name = "right" if side > 0 else "left"
        painted += [(name, "#37474f", _disc(side * x, waist - 0.13, end, 0.075)) for end in (-0.26, 0.26)]
        low, high = sorted((side * 0.08, side * 0.16))
        lamp = (low, waist - 0.08), (high, waist - 0.03)
        painted.append(("front", "#fffde7", _rectangle(2, -z, *lamp)))
        painted.append(("back", RED, _rectangle(2, z, *lamp)))
    return [(body, painted), (cabin, [])]


def draw_car(svg: Svg, cameras: Cameras, shift: FloatArray) -> None:
    """The toy car through the first camera, far faces left out, nearer block last."""
    centre = -cameras.R_cv_from_s[0].T @ cameras.t_cv[0]

    def seen(corners: FloatArray, inside: FloatArray) -> bool:
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        if normal @ (corners[0] - inside) < 0:
            normal = -normal
        return bool(normal @ (centre - corners[0]) > 0)

    blocks = toy_car()
    for faces, painted in blocks if centre[1] > WAIST else blocks[::-1]:
        inside = np.mean([corners.mean(axis=0) for _, corners in faces], axis=0)
        for name, corners in faces:
            if seen(corners, inside):
                svg.polygon(cameras.project(corners)[0] + shift, PAINT[name])
                for where, colour, shape in painted:
                    if where == name:
                        svg.polygon(cameras.project(shape)[0] + shift, colour, INK, 0.7)


def car_points() -> FloatArray:
    """(P, 3) points that hold every extreme of the car."""
    faces = [corners for faces, _ in toy_car() for _, corners in faces]
    return np.concatenate([*faces, *(shape for _, painted in toy_car() for *_, shape in painted)])


def views(path: Path) -> None:
    """What each angle does to the picture."""
    rows = [
        (
            "azimuth (elevation 12°)",
            [
                ((a, 12, 0), f"azimuth {a}°", what)
                for a, what in [(0, "front"), (90, "own left side"), (180, "back"), (270, "own right side")]
            ],
        ),
        (
            "elevation (azimuth 40°)",
            [
                ((40, e, 0), f"elevation {e}°", what)
                for e, what in [
                    (-15, "camera below"),
                    (0, "level"),
                    (35, "camera above"),
                    (90, "from the top"),
                ]
            ],
        ),
        (
            "in-plane rotation (azimuth 40°, elevation 12°)",
            [
                ((40, 12, i), f"in-plane {i:+d}°" if i else "in-plane 0°", what)
                for i, what in [
                    (-25, "clockwise"),
                    (0, "upright"),
                    (25, "counter-clockwise"),
                    (90, "a quarter turn"),
                ]
            ],
        ),
    ]
    side, gap, top = 170, 16, 30
    width, row_height = 4 * side + 5 * gap, side + top + 44
    svg = Svg(width, 3 * row_height + 8, "What azimuth, elevation and in-plane rotation do to the picture")
    for r, (title, tiles) in enumerate(rows):
        svg.text(gap, r * row_height + 22, title, size=14, bold=True)
        for c, (angles, name, what) in enumerate(tiles):
            corner = np.array([gap + c * (side + gap), r * row_height + top])
            svg.polygon(corner + np.array([[0, 0], [side, 0], [side, side], [0, side]]), "#fafafa", FAINT)
            cameras = Cameras.from_rotations(
                rotation_from_angles(*angles), focal_px=1.65 * side, width=side, height=side
            )
            draw_car(svg, cameras, corner)
            svg.text(corner[0] + side / 2, corner[1] + side + 17, name, anchor="middle", bold=True)
            svg.text(corner[0] + side / 2, corner[1] + side + 33, what, GREY, 12, "middle")
    svg.write(path)


def axes(path: Path) -> None:
    """Object frame, camera frame, azimuth, elevation and t_z in one scene, drawn from outside."""
    width, height = 860, 500
    svg = Svg(width, height, "The object's axes, the camera's axes, azimuth, elevation and t_z")
    outside = Cameras.from_rotations(
        rotation_from_angles(348, 30),
        focal_px=1040,
        width=width,
        height=height,
        principal_px=(330, 250),
        t_z=5.6,
    )

    def at(*points: object) -> FloatArray:
        return np.asarray(outside.project(np.array(points, np.float64))[0])

    azimuth, elevation, distance, floor = 52.0, 28.0, 2.0, -0.17
    R = rotation_from_angles(azimuth, elevation)
    eye = -R.T @ np.array([0.0, 0.0, distance])

    def ground(a: float, radius: float) -> list[float]:
        """Below the camera of azimuth ``a``: azimuth 0 is in front (-z), 90 at the own left (-x)."""
        t = np.deg2rad(a)
        return [-radius * np.sin(t), floor, -radius * np.cos(t)]

    ring = 0.98
    svg.line(at(*[ground(a, ring) for a in range(0, 361, 4)]), FAINT, 1.5)
    for a, what in ((0, "0° front"), (90, "90° own left"), (180, "180° back"), (270, "270° own right")):
        (tick,) = at(ground(a, ring))
        svg.dot(tick, GREY, 2.5)
        (label,) = at(ground(a, ring * {0: 1.13, 90: 0.94}.get(a, 1.06)))
        svg.text(label[0], label[1] + 5, what, GREY, 12, "middle" if a == 0 else "end")
    svg.line(at([0, floor, 0], ground(azimuth, distance * np.cos(np.deg2rad(elevation)))), GREY, 1.2, "4 4")
    svg.line(at([0, floor, 0], ground(0, ring)), GREY, 1.2, "4 4")
    draw_car(svg, outside, np.zeros(2))
    svg.arrow(at(*[ground(a, 0.8) for a in np.linspace(0, azimuth, 24)]), VIOLET, 2.5)
    (label,) = at(ground(azimuth * 0.42, 0.86))
    svg.text(label[0] + 4, label[1] + 22, "azimuth", VIOLET, 14, "middle", bold=True)

    # The object's axes; its origin lies inside the car, so the arrows are drawn over it.
    for end, colour, name, (dx, dy) in (
        ([0.62, 0, 0], RED, "x: own right", (-8, -8)),
        ([0, 0.52, 0], GREEN, "y: up", (8, 4)),
        ([0, 0, 0.75], BLUE, "z: back", (-8, -4)),
    ):
        line = at([0, 0, 0], end)
        svg.arrow(line, colour, 2.5)
        svg.text(line[1][0] + dx, line[1][1] + dy, name, colour, 14, "end" if dx < 0 else "start", bold=True)
    svg.dot(at([0, 0, 0])[0])

    # Line of sight and elevation.
    svg.line(at([0, 0, 0], eye), INK, 1.5, "7 4")
    middle = at(eye * 0.42)[0]
    svg.text(middle[0] - 26, middle[1] - 12, "t_z = 2", INK, 14, bold=True)
    level = np.array([eye[0], 0.0, eye[2]])
    svg.line(at([0, 0, 0], level * 1.02), GREY, 1.2, "2 4")
    svg.line(at(level, eye), GREY, 1.2, "2 4")
    forward = level / np.linalg.norm(level)
    arc = [
        1.25 * (np.cos(t) * forward + np.sin(t) * np.array([0.0, 1.0, 0.0]))
        for t in np.linspace(0, np.deg2rad(elevation), 16)
    ]
    svg.arrow(at(*arc), VIOLET, 2.5)
    (label,) = at(arc[12])
    svg.text(label[0] + 8, label[1] + 6, "elevation", VIOLET, 14, bold=True)

    # The camera: image plane with the picture's corners, and its axes.
    corners_cv = np.array([[-0.16, -0.12, 0.3], [0.16, -0.12, 0.3], [0.16, 0.12, 0.3], [-0.16, 0.12, 0.3]])
    frame = corners_cv @ R + eye
    for corner in frame:
        svg.line(at(eye, corner), GREY, 1)
    svg.polygon(at(*frame), "#e3f2fd", GREY)
    for end, colour, name, (dx, dy) in (
        ([0.42, 0, 0], RED, "x: image right", (6, 14)),
        ([0, 0.4, 0], GREEN, "y: image down", (6, 12)),
        ([0, 0, 0.62], BLUE, "z: forward", (-6, -12)),
    ):
        line = at(eye, np.array(end) @ R + eye)
        svg.arrow(line, colour, 2.5)
        svg.text(line[1][0] + dx, line[1][1] + dy, name, colour, 14, "end" if dx < 0 else "start", bold=True)
    svg.dot(at(eye)[0])
    svg.text(16, 28, "Object: ShapeNet axes (s), camera: OpenCV axes (cv)", INK, 15, bold=True)
    svg.text(16, 48, "This camera: azimuth 52°, elevation 28°, in-plane 0°", GREY, 13)
    svg.write(path)


def pixels(path: Path) -> None:
    """Continuous pixel coordinates: centres at halves, boxes that end after the last pixel."""
    cell, left, top = 62, 60, 56
    svg = Svg(560, 330, "Continuous pixel coordinates")
    for c, r in ((2, 1), (3, 1), (2, 2), (3, 2), (4, 2)):
        corner = np.array([left + c * cell, top + r * cell])
        svg.polygon(corner + np.array([[0, 0], [cell, 0], [cell, cell], [0, cell]]), "#c8e6c9", FAINT)
    for k in range(7):
        svg.line(np.array([[left + k * cell, top], [left + k * cell, top + 4 * cell]]), FAINT, 1)
        svg.text(left + k * cell, top - 8, f"{k}", GREY, 12, "middle")
    for k in range(5):
        svg.line(np.array([[left, top + k * cell], [left + 6 * cell, top + k * cell]]), FAINT, 1)
        svg.text(left - 10, top + k * cell + 4, f"{k}", GREY, 12, "end")
    svg.arrow(np.array([[left, top - 28], [left + 90, top - 28]]), RED)
    svg.text(left + 96, top - 24, "x (columns)", RED, 13)
    svg.arrow(np.array([[left - 34, top], [left - 34, top + 90]]), GREEN)
    svg.text(left - 46, top + 108, "y (rows)", GREEN, 13)
    box = np.array([[2, 1], [5, 1], [5, 3], [2, 3], [2, 1]]) * cell + [left, top]
    svg.line(box, BLUE, 3)
    centre = np.array([left + 2.5 * cell, top + 1.5 * cell])
    svg.dot(centre)
    svg.text(centre[0], centre[1] - 9, "(2.5, 1.5)", INK, 12, "middle")
    svg.text(left + 6 * cell + 12, top + 84, "mask (green)", GREEN, 13)
    svg.text(left + 6 * cell + 12, top + 106, "its box (2, 1, 5, 3)", BLUE, 13)
    svg.text(
        left,
        top + 4 * cell + 20,
        "Pixel in column 2, row 1 covers [2, 3) x [1, 2); its centre is (2.5, 1.5).",
        GREY,
        13,
    )
    svg.write(path)


def alignment(path: Path) -> None:
    """Box, principal point and focal length in a photo (the paper's Fig. 4)."""
    svg = Svg(640, 380, "How detection box, principal point and focal length relate")
    photo = np.array([[20, 40], [620, 40], [620, 340], [20, 340]])
    svg.polygon(photo, "#fafafa", GREY)
    box = np.array([262.0, 104.0, 582.0, 272.0])
    middle = (box[:2] + box[2:]) / 2
    R = rotation_from_angles(62, 14)
    u = projected_rectangle(R, car_points())[0]
    best = focal_from_box(u, Box(*box)).focal_px
    cameras = Cameras.from_rotations(R, focal_px=best, principal_px=middle, width=640, height=380)
    draw_car(svg, cameras, np.zeros(2))
    for focal, colour, dash in ((0.7 * best, INK, "4 4"), (best, BLUE, "")):
        x0, y0, x1, y1 = u * focal + np.tile(middle, 2)
        svg.line(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]), colour, 2, dash)
    x0, y0, x1, y1 = box
    svg.line(np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]), RED, 2.5)
    svg.line(np.array([[middle[0] - 9, middle[1]], [middle[0] + 9, middle[1]]]), RED, 2.5)
    svg.line(np.array([[middle[0], middle[1] - 9], [middle[0], middle[1] + 9]]), RED, 2.5)
    svg.text(20, 28, "Photo", INK, 14, bold=True)
    svg.text(36, 128, "detection box", RED, 13, bold=True)
    svg.text(36, 146, "+ its middle = principal point O", RED, 13)
    svg.text(36, 178, "rectangle of the model", BLUE, 13, bold=True)
    svg.text(36, 196, "at the best f: most overlap", BLUE, 13)
    svg.text(36, 228, "dashed: at 0.7 f, the same", INK, 13)
    svg.text(36, 246, "rectangle scaled about O", INK, 13)
    svg.text(
        20, 364, "O is where the object's origin projects to. It is not the middle of the photo.", GREY, 13
    )
    svg.write(path)


FIGURES = {"views.svg": views, "axes.svg": axes, "pixels.svg": pixels, "alignment.svg": alignment}


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        draw(folder / name)


if __name__ == "__main__":
    here = Path(__file__).resolve().parent.parent / "docs" / "figures"
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else here)
