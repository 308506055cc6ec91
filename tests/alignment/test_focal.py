from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cadpose.alignment.focal import align, focal_from_box, focals_from_box
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.camera import projected_rectangle
from cadpose.geometry.frames import FloatArray
from cadpose.records import Rotation

GRID = 4000


def rectangle_iou(f: FloatArray, u: FloatArray, box: Box, principal: tuple[float, float]) -> FloatArray:
    rectangles = np.asarray(f)[:, None] * u + np.tile(principal, 2)
    return box_iou(rectangles, np.array(box.to_tuple()))


def edge(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False)


@given(
    edge(-0.4, 0.1), edge(-0.4, 0.1), edge(0.02, 0.6), edge(0.02, 0.6),
    edge(0, 500), edge(0, 500), edge(5, 900), edge(5, 900), edge(-0.3, 1.3), edge(-0.3, 1.3),
)  # fmt: skip
@settings(max_examples=300, deadline=None)
def test_no_focal_of_a_fine_grid_is_better(
    x: float, y: float, w: float, h: float, bx: float, by: float, bw: float, bh: float, ox: float, oy: float
) -> None:
    u, box = np.array([x, y, x + w, y + h]), Box.from_xywh(bx, by, bw, bh)
    principal = (bx + ox * bw, by + oy * bh)
    fit = focal_from_box(u, box, principal)
    assert fit.focal_px > 0
    assert fit.box_iou == pytest.approx(
        float(rectangle_iou(np.array([fit.focal_px]), u, box, principal)[0]), abs=1e-9
    )
    grid = np.geomspace(0.05, 200.0, GRID) * np.hypot(bw, bh)
    brute = rectangle_iou(grid, u, box, principal)
    assert fit.box_iou >= brute.max() - 1e-9
    # The grid's neighbouring values differ by 0.2 %, so its best cannot be much worse either.
    if 1.001 * grid[0] < fit.focal_px < 0.999 * grid[-1]:
        assert fit.box_iou <= brute.max() + 0.01


def test_concentric_rectangles_have_equal_areas_at_the_optimum() -> None:
    u, box = np.array([-0.3, -0.1, 0.3, 0.1]), Box(100, 50, 300, 250)
    fit = focal_from_box(u, box)
    assert fit.focal_px == pytest.approx(np.sqrt(box.area / 0.12))


def test_exact_fit_has_iou_one_and_the_true_focal() -> None:
    u = np.array([-0.21, -0.05, 0.33, 0.17])
    box = Box(*(777.0 * u + np.tile([400.0, 300.0], 2)))
    fit = focal_from_box(u, box, (400.0, 300.0))
    assert fit.focal_px == pytest.approx(777.0)
    assert fit.box_iou == pytest.approx(1.0)


def test_many_rectangles_at_once_equal_one_by_one() -> None:
    rng = np.random.default_rng(3)
    low = rng.uniform(-0.4, 0.0, (50, 2))
    u = np.concatenate([low, low + rng.uniform(0.05, 0.6, (50, 2))], axis=1)
    box = Box(10, 20, 210, 110)
    focal, iou = focals_from_box(u, box, (80.0, 60.0))
    for i in range(len(u)):
        one = focal_from_box(u[i], box, (80.0, 60.0))
        assert (one.focal_px, one.box_iou) == (focal[i], iou[i])


def test_no_overlap_at_any_focal_gives_zero_iou_and_equal_diagonals() -> None:
    box = Box(0, 0, 30, 40)
    fit = focal_from_box(np.array([0.1, 0.1, 0.4, 0.5]), box, (100.0, 100.0))
    assert fit.box_iou == 0.0
    assert fit.focal_px == pytest.approx(100.0)
    flat = focal_from_box(np.array([-0.5, 0.0, 0.5, 0.0]), box)
    assert flat.focal_px == pytest.approx(50.0)
    assert flat.box_iou == 0.0


@pytest.mark.parametrize(
    "u", [[0.0, 0.0, 0.0, 0.0], [0.2, 0.0, 0.1, 0.3], [np.nan, 0.0, 1.0, 1.0], [0.0, 0.0, np.inf, 1.0]]
)
def test_impossible_rectangles_are_refused(u: list[float]) -> None:
    with pytest.raises(ValueError, match="rectangle"):
        focal_from_box(np.array(u), Box(0, 0, 1, 1))


def box_corners(w: float, h: float, d: float) -> FloatArray:
    signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
    return np.asarray(signs * np.array([w, h, d]) / 2.0)


def box_surface(w: float, h: float, d: float, n: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    size = np.array([w, h, d])
    areas = np.array([h * d, w * d, w * h])
    axis = rng.choice(3, n, p=areas / areas.sum())
    points = rng.uniform(-0.5, 0.5, (n, 3))
    points[np.arange(n), axis] = rng.choice([-0.5, 0.5], n)
    return np.asarray(points * size)


def paper_focal(points: FloatArray, R: FloatArray, box: Box) -> float:
    """The paper's way: project 60,000 surface samples, scan f for the best rectangle IoU."""
    u = projected_rectangle(R, points)[0]
    grid = np.linspace(100.0, 2000.0, 19001)
    return float(grid[rectangle_iou(grid, u, box, box.centre).argmax()])


@pytest.mark.parametrize(("azimuth", "elevation"), [(30.0, 10.0), (200.0, 35.0), (90.0, 0.0)])
def test_agrees_with_the_papers_sampling_on_a_box(azimuth: float, elevation: float) -> None:
    w, h, d = 0.45, 0.35, 0.8
    R = rotation_from_angles(azimuth, elevation)
    box = Box(50, 80, 410, 300)
    exact = focal_from_box(projected_rectangle(R, box_corners(w, h, d))[0], box).focal_px
    sampled = paper_focal(box_surface(w, h, d, 60_000, seed=1), R, box)
    # Samples miss the corners, so the sampled rectangle is smaller and f slightly larger.
    assert exact * 0.999 < sampled < exact * 1.02


def test_agrees_with_the_papers_sampling_on_a_sphere() -> None:
    rng = np.random.default_rng(0)
    points = rng.normal(size=(60_000, 3))
    points *= 0.5 / np.linalg.norm(points, axis=1, keepdims=True)
    box = Box(0, 0, 300, 300)
    # The outline of a sphere of radius r at distance d lies at r / sqrt(d² - r²).
    edge_u = 0.5 / np.sqrt(4.0 - 0.25)
    exact = focal_from_box(np.array([-edge_u, -edge_u, edge_u, edge_u]), box).focal_px
    assert paper_focal(points, np.eye(3), box) == pytest.approx(exact, rel=2e-3)


@given(edge(0, 360), edge(-60, 60), edge(-30, 30), edge(50, 3000))
@settings(max_examples=60, deadline=None)
def test_align_recovers_the_focal_of_a_projected_model(az: float, el: float, roll: float, f: float) -> None:
    points = box_corners(0.4, 0.3, 0.7)
    rotation = Rotation(az, el, roll)
    u = projected_rectangle(rotation.to_matrix(), points)[0]
    box = Box(*(f * u + np.tile([640.0, 360.0], 2)))
    pose, iou = align(points, rotation, box, principal_px=(640.0, 360.0))
    assert pose.focal_px == pytest.approx(f, rel=1e-6)
    assert iou == pytest.approx(1.0, abs=1e-6)
    centred, centred_iou = align(points, rotation, box, centred=True)
    assert centred_iou == pytest.approx(1.0, abs=1e-6)
    assert centred.principal_px == pytest.approx((640.0, 360.0), abs=1e-3 * max(f, 1.0))
    _, default_iou = align(points, rotation, box)
    assert default_iou <= iou + 1e-9


def test_align_refuses_two_principal_points() -> None:
    with pytest.raises(ValueError, match="either"):
        align(
            box_corners(1, 1, 1) / 2, Rotation(0, 0), Box(0, 0, 9, 9), principal_px=(1.0, 1.0), centred=True
        )
