"""Draws the figures of docs/concepts.md as SVG, with the project's own geometry, fit and bracket.

python scripts/draw_concepts.py [FOLDER]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from draw_conventions import BLUE, FAINT, GREEN, GREY, INK, PAINT, RED, VIOLET, Svg, car_points, draw_car

from cadpose.alignment.focal import focal_from_box
from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.camera import Cameras, projected_rectangle
from cadpose.geometry.frames import FloatArray
from cadpose.records import Rotation, RotationHypothesis
from cadpose.rotation.grid import grid_angles, grid_rotations
from cadpose.similarity.joint.bracket import RADIUS, Bracket

SKY, LAWN = "#dce9f5", "#d5e3c5"


def _frame(x0: float, y0: float, x1: float, y1: float) -> FloatArray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]], np.float64)


def _car(
    svg: Svg, angles: tuple[float, float, float], focal: float, at: tuple[float, float], paint: str = ""
) -> FloatArray:
    """The toy car with its origin at a place; gives its (4,) rectangle there."""
    R = rotation_from_angles(*angles)
    cameras = Cameras.from_rotations(R, focal_px=focal, principal_px=at, width=10, height=10)
    usual = dict(PAINT)
    if paint:
        PAINT.update(front=paint, left=paint, right=paint, back=paint)
    draw_car(svg, cameras, np.zeros(2))
    PAINT.update(usual)
    return np.asarray(projected_rectangle(R, car_points())[0] * focal + np.tile(at, 2))


def pipeline(path: Path) -> None:
    """A photo's way through the stages, and where the CAD library comes in."""
    side, gap, left, top, rise = 200, 34, 16, 34, 258
    svg = Svg(716, 640, "How a photo walks through the stages, and what the CAD library gives to each")
    true = (52.0, 12.0, 3.0)

    def tile(n: int, name: str, what: str) -> tuple[float, float]:
        x, y = left + n % 3 * (side + gap), top + n // 3 * rise
        svg.text(x, y - 10, f"{n + 1}  {name}", INK, 15, bold=True)
        svg.polygon(_frame(x, y, x + side, y + 150), "#fafafa", FAINT)
        for i, line in enumerate(what.split("|")):
            svg.text(x, y + 169 + 16 * i, line, GREY, 12)
        if n % 3 < 2:
            svg.arrow(np.array([[x + side + 5, y + 75], [x + side + gap - 4, y + 75]]), INK)
        elif n == 2:
            svg.arrow(
                np.array(
                    [
                        [x + side + 6, y + 75],
                        [x + side + 14, y + 75],
                        [x + side + 14, y + 216],
                        [left + 90, y + 216],
                        [left + 90, y + rise - 24],
                    ]
                ),
                INK,
            )
        return x, y

    def scene(x: float, y: float) -> FloatArray:
        svg.polygon(_frame(x, y, x + side, y + 75), SKY, "none")
        svg.polygon(_frame(x, y + 75, x + side, y + 150), LAWN, "none")
        svg.line(_frame(x, y, x + side, y + 150), FAINT, 1)
        return _car(svg, true, 250, (x + 104, y + 84))

    scene(*tile(0, "photo", "pixels, EXIF's orientation applied"))
    x, y = tile(1, "detection", "box, category, score; mask|or all of it told by you")
    x0, y0, x1, y1 = scene(x, y)
    svg.line(_frame(x0 - 2, y0 - 2, x1 + 2, y1 + 2), RED, 2)
    svg.text(x0 - 2, y0 - 8, "car 0.93", RED, 12, bold=True)
    x, y = tile(2, "rotation", "hypotheses and their chances to|be within 30°; three are followed")
    for i, (angles, chance) in enumerate(
        [((40, 16, 0), "0.71"), ((222, 16, 0), "0.18"), ((100, 16, 0), "0.06")]
    ):
        centre = (x + 35 + 65 * i, y + 66)
        _car(svg, angles, 95, centre)
        svg.text(centre[0], y + 122, chance, INK, 12, "middle", bold=i == 0)
    x, y = tile(3, "ranking", "model and rotation together: by|cached views, then five are drawn")
    for i, (paint, chance) in enumerate([("", "0.80"), ("#ef9a9a", "0.07"), ("#a5d6a7", "0.03")]):
        centre = (x + 35 + 65 * i, y + 66)
        rect = _car(svg, (49, 13, 2), 95, centre, paint)
        if i == 0:
            svg.line(_frame(rect[0] - 4, rect[1] - 6, rect[2] + 4, rect[3] + 6), "#ef6c00", 2)
        svg.text(centre[0], y + 122, chance, INK, 12, "middle", bold=i == 0)
    svg.text(x + side / 2, y + 142, "none of them 0.06", GREY, 11, "middle")
    x, y = tile(4, "alignment, refinement", "focal length by box or mask; then|render and compare")
    x0, y0, x1, y1 = scene(x, y)
    svg.line(_frame(x0 - 2, y0 - 2, x1 + 2, y1 + 2), RED, 2)
    svg.line(_frame(x0, y0, x1, y1), BLUE, 2)
    x, y = tile(5, "annotation", "a document, pictures, a row in the|store; people decide")
    for i, line in enumerate(
        [
            "model     van, chance 0.80",
            "azimuth   52°   elevation 12°",
            "in-plane  3°    f 250 px",
            "within 30°      0.71",
            "verdict   review 0.64",
        ]
    ):
        svg.text(x + 10, y + 32 + 24 * i, line, INK, 12)

    x0, y0, x1 = left, top + 2 * rise - 12, left + 3 * side + 2 * gap
    svg.polygon(_frame(x0, y0, x1, y0 + 86), "#eceff1", GREY)
    svg.text(x0 + 12, y0 + 24, "CAD library", INK, 15, bold=True)
    svg.text(x0 + 12, y0 + 44, "meshes in one frame,", GREY, 12)
    svg.text(x0 + 12, y0 + 60, "symmetry, licence", GREY, 12)
    for i, (what, where) in enumerate(
        [
            (f"{len(grid_angles())} cached views", "to rotation (3) and ranking (4)"),
            ("candidates", "the category's, or by the view index, to (4)"),
            ("the mesh", "to alignment and refinement (5)"),
        ]
    ):
        svg.text(x0 + 200, y0 + 26 + 24 * i, what, INK, 13, bold=True)
        svg.text(x0 + 350, y0 + 26 + 24 * i, where, GREY, 13)
    svg.write(path)


def bracket(path: Path) -> None:
    """Which cached views the joint ranking compares, and where the rotation settles."""
    width, height, left, top, right, bottom = 760, 400, 56, 64, 744, 330
    svg = Svg(width, height, "The bracket: cached views about the rotation hypotheses")
    true = rotation_from_angles(46.0, 17.0)
    hypotheses = [
        RotationHypothesis(Rotation(a, e), 0.0, p)
        for a, e, p in ((35, 22, 0.6), (218, 24, 0.2), (120, 8, 0.1))
    ]
    found = Bracket.about(hypotheses, grid_rotations())
    # A score as a good measure would give it: the nearer the truth, the higher; its other side a little too.
    other_side = rotation_from_angles(226.0, 17.0)
    scores = 0.9 - 0.008 * geodesic_degrees(found.rotations, true)
    scores = np.maximum(scores, 0.7 - 0.008 * geodesic_degrees(found.rotations, other_side))
    scores = scores - found.cost
    settled = Rotation.from_matrix(found.settled(scores))

    def at(azimuth: float, elevation: float) -> tuple[float, float]:
        return left + azimuth / 360 * (right - left), bottom - (elevation + 12) / 76 * (bottom - top)

    svg.polygon(_frame(left, top, right, bottom), "#fafafa", FAINT)
    for a in range(0, 361, 45):
        svg.line(np.array([at(a, -12), at(a, 64)]), "#eeeeee", 1)
        svg.text(at(a, 0)[0], bottom + 18, f"{a}°", GREY, 12, "middle")
    for e in (0, 20, 40, 60):
        svg.line(np.array([at(0, e), at(360, e)]), "#eeeeee", 1)
        svg.text(left - 8, at(0, e)[1] + 4, f"{e}°", GREY, 12, "end")
    svg.text((left + right) / 2, bottom + 38, "azimuth", GREY, 13, "middle")
    svg.text(12, top - 8, "elevation", GREY, 13)
    angles = grid_angles()
    near = {int(n): float(s) for n, s in zip(found.near, scores, strict=True)}
    high, low = scores.max(), scores.min()
    for n, (azimuth, elevation, inplane) in enumerate(angles):
        if inplane:
            continue
        place = np.array(at(azimuth, elevation))
        if n in near:
            svg.dot(place, BLUE, 2.5 + 5.5 * (near[n] - low) / (high - low))
        else:
            svg.dot(place, FAINT, 2)
    turn = np.linspace(0, 2 * np.pi, 72)
    for i, hypothesis in enumerate(hypotheses):
        a, e = hypothesis.rotation.azimuth, hypothesis.rotation.elevation
        ring = np.array(
            [at(a + RADIUS * np.cos(t) / np.cos(np.deg2rad(e)), e + RADIUS * np.sin(t)) for t in turn]
        )
        svg.line(np.clip(ring, (left, top), (right, bottom)), RED, 1.2, "4 3")
        x, y = at(a, e)
        svg.line(np.array([[x - 6, y - 6], [x + 6, y + 6]]), RED, 2.5)
        svg.line(np.array([[x - 6, y + 6], [x + 6, y - 6]]), RED, 2.5)
        svg.text(
            x,
            max(ring[:, 1].min(), top) - 6,
            f"{i + 1}: {hypothesis.probability:.1f}",
            RED,
            13,
            "middle",
            bold=True,
        )
    best = angles[found.near[int(scores.argmax())]]
    x, y = at(best[0], best[1])
    svg.line(np.array([[x + 9 * np.cos(t), y + 9 * np.sin(t)] for t in turn]), GREEN, 2.5)
    x, y = at(settled.azimuth, settled.elevation)
    svg.polygon(np.array([[x, y - 8], [x + 8, y], [x, y + 8], [x - 8, y]]), VIOLET, "#ffffff", 1.5)
    legend = [
        (RED, "hypotheses, with probability; 26° about them"),
        (BLUE, "views compared: the larger, the better"),
    ]
    legend += [(GREEN, "best view"), (VIOLET, "where the rotation settles")]
    for i, (colour, what) in enumerate(legend):
        x, y = left + (i % 2) * 350, 20 + 20 * (i // 2)
        svg.dot((x + 5, y - 4), colour, 5)
        svg.text(x + 16, y, what, INK, 13)
    svg.text(left, height - 8, "Grey: cached views that are not compared. Scores made up.", GREY, 12)
    svg.write(path)


def focal(path: Path) -> None:
    """The focal length as the one whose rectangle overlaps the box most."""
    svg = Svg(760, 400, "Focal length: the rectangle that overlaps the detection box most")
    R = rotation_from_angles(62, 5)
    u = projected_rectangle(R, car_points())[0]
    box = Box(-74, -40, 74, 38)
    best = focal_from_box(u, box).focal_px
    middle = np.array(box.centre)
    factors = (0.65, 1.0, 1.3)

    def iou(f: float) -> float:
        return float(box_iou(u * f + np.tile(middle, 2), np.array(box.to_tuple())))

    for i, factor in enumerate(factors):
        x, y = 16 + i * 246, 34
        svg.polygon(_frame(x, y, x + 236, y + 156), "#fafafa", FAINT)
        origin = np.array([x + 118, y + 80])
        at = origin + middle
        rect = _car(svg, (62, 5, 0), factor * best, (float(at[0]), float(at[1])))
        svg.line(_frame(*rect), BLUE, 2)
        svg.line(_frame(*(np.array(box.to_tuple()) + np.tile(origin, 2))), RED, 2.5)
        name = "best f" if factor == 1 else f"{factor:g} f"
        svg.text(x, y - 10, f"{name}: IoU {iou(factor * best):.2f}", INK, 14, bold=True)
    left, top, right, bottom = 70, 226, 740, 358
    svg.polygon(_frame(left, top, right, bottom), "#fafafa", FAINT)

    def at_curve(factor: float, value: float) -> list[float]:
        return [left + (factor - 0.4) / 1.4 * (right - left), bottom - value * (bottom - top)]

    for value in (0.0, 0.5, 1.0):
        svg.text(left - 8, at_curve(0.4, value)[1] + 4, f"{value:g}", GREY, 12, "end")
    for factor in (0.4, 0.65, 1.0, 1.3, 1.8):
        svg.text(
            at_curve(factor, 0)[0],
            bottom + 18,
            "best f" if factor == 1 else f"{factor:g} f",
            GREY,
            12,
            "middle",
        )
    svg.line(np.array([at_curve(f, iou(f * best)) for f in np.linspace(0.4, 1.8, 141)]), INK, 2)
    for factor in factors:
        svg.dot(np.array(at_curve(factor, iou(factor * best))), BLUE, 5)
    svg.text(16, top - 6, "IoU", GREY, 13)
    svg.text(
        16,
        392,
        "Red: detection box. Blue: rectangle of the model. The maximum has a closed form; no f is tried.",
        GREY,
        12,
    )
    svg.write(path)


FIGURES = {"pipeline.svg": pipeline, "bracket.svg": bracket, "focal.svg": focal}


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in FIGURES.items():
        draw(folder / name)


if __name__ == "__main__":
    here = Path(__file__).resolve().parent.parent / "docs" / "figures"
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else here)
