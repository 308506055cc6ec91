"""Putting things into a picture: shadows, drawn objects, covers."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.rendering.lights import Lights
from cadpose.training.synth.kernels import blend, darken

Picture = NDArray[np.uint8]
#: Shadows are drawn at this share of the photo's side: they are soft.
_SHADOW_SCALE = 4


def paste(canvas: Picture, rgb: Picture, alpha: NDArray[np.uint8]) -> None:
    """Draw ``rgb`` (H, W, 3) over ``canvas``, in place, where ``alpha`` (H, W) is above zero."""
    blend(canvas, rgb, alpha)


def relight(canvas: Picture, light: NDArray[np.float32]) -> None:
    """Multiply ``canvas``, in place, by (H, W, 3) linear light of at most 1."""
    # sRGB is nearly a power of linear light: its factor is the light's root.
    canvas[:] = np.rint(canvas * light ** np.float32(1.0 / 2.2)).astype(np.uint8)


def shade_ground(
    canvas: Picture, vertices: NDArray[np.float32], camera: Cameras, lights: Lights, rng: np.random.Generator
) -> None:
    """Darken ``canvas``, in place, where the shape's shadow falls on the ground it stands on.

    The shadow is that of the convex hull, cast by the key light; below that a tight one where the shape
    touches the ground. One light, no wall.
    """
    R, t_z = camera.R_cv_from_s[0], float(camera.t_cv[0, 2])
    points = vertices[:: max(1, len(vertices) // 400)].astype(np.float64)
    ground = float(points[:, 1].min())
    to_light = R.T @ np.asarray(lights.key)
    low = points[points[:, 1] < ground + 0.06]
    size = max(8, canvas.shape[0] // _SHADOW_SCALE)
    dark = np.zeros((size, size), np.float32)
    if to_light[1] > 0.25:
        reach = (points[:, 1] - ground) / to_light[1]
        _fill(
            dark, points - reach[:, None] * to_light, camera, R, t_z, canvas.shape[0], rng.uniform(0.2, 0.6)
        )
    if len(low) > 2:
        foot = low.copy()
        foot[:, 1] = ground
        _fill(dark, foot, camera, R, t_z, canvas.shape[0], rng.uniform(0.2, 0.7))
    if not dark.any():
        return
    dark = cv2.GaussianBlur(dark, (0, 0), rng.uniform(0.6, 3.5) * size / 56)
    large = cv2.resize(dark, (canvas.shape[1], canvas.shape[0]), interpolation=cv2.INTER_LINEAR)
    darken(canvas, np.asarray(large, np.float32))


def _fill(
    dark: NDArray[np.float32],
    points: FloatArray,
    camera: Cameras,
    R: FloatArray,
    t_z: float,
    side: int,
    strength: float,
) -> None:
    x_cv = points @ R.T + (0.0, 0.0, t_z)
    x_cv = x_cv[x_cv[:, 2] > 0.2]
    if len(x_cv) < 3:
        return
    pixels = camera.focal_px[0] * x_cv[:, :2] / x_cv[:, 2:] + camera.principal_px[0]
    scaled = np.clip(pixels * (dark.shape[0] / side), -1e4, 1e4).astype(np.int32)
    mask = np.zeros(dark.shape, np.uint8)
    cv2.fillConvexPoly(mask, cv2.convexHull(scaled), 1)
    np.maximum(dark, mask * np.float32(strength), out=dark)


def cover(size: int, box: FloatArray, rng: np.random.Generator) -> NDArray[np.uint8]:
    """(size, size) alpha of something before an object's rectangle: a slab, a post, a blob or a wedge."""
    x0, y0, x1, y1 = box
    w, h = x1 - x0, y1 - y0
    alpha = np.zeros((size, size), np.uint8)
    kind = rng.integers(4)
    share = rng.uniform(0.08, 0.35)
    if kind == 0:  # from one side
        side = rng.integers(4)
        corner = {
            0: (x0 - 1, y0 - 1, x0 + w * share, y1 + 1),
            1: (x1 - w * share, y0 - 1, x1 + 1, y1 + 1),
            2: (x0 - 1, y1 - h * share, x1 + 1, y1 + 1),
            3: (x0 - 1, y0 - 1, x1 + 1, y0 + h * share * 0.7),
        }[int(side)]
        cv2.rectangle(alpha, _at(corner[0], corner[1]), _at(corner[2], corner[3]), 255, -1)
    elif kind == 1:  # a post
        at = rng.uniform(x0, x1)
        half = w * share / 4
        cv2.rectangle(alpha, _at(at - half, y0 - h), _at(at + half, y1 + h), 255, -1)
    elif kind == 2:
        middle = _at(rng.uniform(x0, x1), rng.uniform(y0 + h / 3, y1))
        axes = (max(1, int(w * share)), max(1, int(h * share)))
        cv2.ellipse(alpha, middle, axes, float(rng.uniform(0, 180)), 0, 360, 255, -1)
    else:
        about = np.array([rng.uniform(x0, x1), rng.uniform(y0, y1)])
        points = about + rng.normal(size=(int(rng.integers(3, 7)), 2)) * np.array([w, h]) * share
        cv2.fillConvexPoly(alpha, cv2.convexHull(points.astype(np.int32)), 255)
    return np.asarray(cv2.GaussianBlur(alpha, (3, 3), 0), np.uint8)


def _at(x: float, y: float) -> tuple[int, int]:
    return int(np.clip(x, -4096, 8192)), int(np.clip(y, -4096, 8192))
