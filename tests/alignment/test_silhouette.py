from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.alignment.silhouette import focal_from_mask
from cadpose.geometry.boxes import mask_iou
from cadpose.geometry.camera import Cameras
from cadpose.records import Mask


def draw(
    shape: str, f: float, principal: tuple[float, float], width: int, height: int, squeeze: float = 1.0
) -> Mask:
    """An analytic silhouette at focal length f: a tilted ellipse with a wing, or an L, at normalised x/z."""
    x = (np.arange(width) + 0.5 - principal[0]) / f
    y = (np.arange(height) + 0.5 - principal[1]) / f * squeeze
    X, Y = np.meshgrid(x, y)
    if shape == "ellipse":
        a, b = X * 0.9 + Y * 0.43, Y * 0.9 - X * 0.43
        return np.asarray(((a - 0.02) / 0.2) ** 2 + (b / 0.09) ** 2 <= 1)
    tall = (np.abs(X + 0.08) < 0.05) & (np.abs(Y) < 0.15)
    foot = (np.abs(X - 0.02) < 0.15) & (np.abs(Y - 0.12) < 0.03)
    return np.asarray(tall | foot)


def render_coverage(shape: str, f: float, principal: tuple[float, float], size: int) -> NDArray[np.uint8]:
    """The same with anti-aliased edges, as a renderer's alpha."""
    fine = draw(shape, 8 * f, (8 * principal[0], 8 * principal[1]), 8 * size, 8 * size)
    assert not (fine[0].any() or fine[-1].any() or fine[:, 0].any() or fine[:, -1].any())
    return np.asarray(fine.reshape(size, 8, size, 8).mean(axis=(1, 3)) * 255.0).astype(np.uint8)


def camera(f: float, principal: tuple[float, float], size: int) -> Cameras:
    return Cameras.from_rotations(np.eye(3), focal_px=f, width=size, height=size, principal_px=principal)


@pytest.mark.parametrize("shape", ["ellipse", "ell"])
@pytest.mark.parametrize(
    ("f_true", "size"), [(180.0, (160, 120)), (900.0, (640, 480)), (3100.0, (2000, 1500))]
)
def test_recovers_the_focal_of_the_same_silhouette(shape: str, f_true: float, size: tuple[int, int]) -> None:
    render_camera = camera(450.0, (110.0, 115.0), 224)
    render = render_coverage(shape, 450.0, (110.0, 115.0), 224)
    principal = (size[0] * 0.47, size[1] * 0.52)
    photo = draw(shape, f_true, principal, *size)
    fit = focal_from_mask(render, render_camera, photo, principal)
    # One pixel of the smallest photo's object is 2 % of it.
    assert fit.focal_px == pytest.approx(f_true, rel=0.02 if f_true < 200 else 0.005)
    assert fit.mask_iou is not None
    assert fit.mask_iou > (0.94 if f_true < 200 else 0.98)
    assert fit.box_iou > 0.95


@pytest.mark.parametrize(("shape", "other"), [("ellipse", "ell"), ("ell", "ell")])
def test_agrees_with_rendering_every_focal_again(shape: str, other: str) -> None:
    width, height, principal = 250, 200, (120.0, 107.0)
    photo = draw(other, 400.0, principal, width, height, squeeze=1.25)
    render = render_coverage(shape, 550.0, (128.0, 128.0), 256)
    fit = focal_from_mask(render, camera(550.0, (128.0, 128.0), 256), photo, principal)
    # Outlines along the pixel grid: compare three times as finely as the photo's pixels.
    fine_photo = np.kron(photo, np.ones((3, 3), bool))
    fine_principal = (3 * principal[0], 3 * principal[1])

    def brute(f: float) -> float:
        return mask_iou(draw(shape, 3 * f, fine_principal, 3 * width, 3 * height), fine_photo)

    coarse = np.geomspace(240, 700, 24)
    top = coarse[np.argmax([brute(float(f)) for f in coarse])]
    best = max(brute(float(f)) for f in np.linspace(0.95 * top, 1.05 * top, 26))
    assert fit.mask_iou == pytest.approx(best, abs=0.005)
    assert brute(fit.focal_px) >= best - 0.005


def test_principal_point_defaults_to_the_middle_of_the_masks_box() -> None:
    photo = draw("ell", 600.0, (210.0, 190.0), 400, 400)
    rows, cols = np.flatnonzero(photo.any(1)), np.flatnonzero(photo.any(0))
    middle = ((cols[0] + cols[-1] + 1) / 2.0, (rows[0] + rows[-1] + 1) / 2.0)
    render = draw("ell", 500.0, (128.0, 128.0), 256, 256)
    view = camera(500.0, (128.0, 128.0), 256)
    assert focal_from_mask(render, view, photo) == focal_from_mask(render, view, photo, middle)


def test_centred_finds_focal_and_principal_point_of_a_displaced_object() -> None:
    principal = (231.0, 188.0)
    photo = draw("ell", 700.0, principal, 450, 400)
    render = render_coverage("ell", 550.0, (120.0, 131.0), 256)
    fit = focal_from_mask(render, camera(550.0, (120.0, 131.0), 256), photo, centred=True)
    assert fit.focal_px == pytest.approx(700.0, rel=0.01)
    assert fit.principal_px == pytest.approx(principal, abs=1.0)
    assert fit.mask_iou is not None
    assert fit.mask_iou > 0.97
    with pytest.raises(ValueError, match="either"):
        focal_from_mask(render, camera(550.0, (120.0, 131.0), 256), photo, principal, centred=True)


def test_uint8_coverage_counts_as_a_mask() -> None:
    render = draw("ell", 500.0, (128.0, 128.0), 256, 256)
    photo = draw("ell", 300.0, (100.0, 100.0), 200, 200)
    view = camera(500.0, (128.0, 128.0), 256)
    by_bool = focal_from_mask(render, view, photo, (100.0, 100.0))
    by_alpha = focal_from_mask(render.astype(np.uint8) * 255, view, photo, (100.0, 100.0))
    assert by_alpha.focal_px == pytest.approx(by_bool.focal_px, rel=1e-6)


def test_empty_masks_and_foreign_cameras_are_refused() -> None:
    full, view = np.ones((64, 64), bool), camera(100.0, (32.0, 32.0), 64)
    with pytest.raises(ValueError, match="empty"):
        focal_from_mask(~full, view, full)
    with pytest.raises(ValueError, match="empty"):
        focal_from_mask(full, view, ~full)
    with pytest.raises(ValueError, match="camera"):
        focal_from_mask(full, camera(100.0, (16.0, 16.0), 32), full)
