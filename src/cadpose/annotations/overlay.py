"""The overlay: the photo with its models blended in, their outlines, axes, boxes and labels."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from cadpose.annotations.marks import SHIFT, extent, label, line, outline, rectangle
from cadpose.annotations.style import Colour, colour_of, font, label_text, resized
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.records import Annotation, Photo, Pose4Dof, Views

#: The overlay's longer side: small photos are enlarged so that labels can be read, large ones reduced.
MIN_SIDE, MAX_SIDE = 960, 1600

# The object's own axes from its origin, in units of its bounding-box diagonal.
_AXES: tuple[tuple[str, tuple[float, float, float], Colour], ...] = (
    ("right", (0.24, 0.0, 0.0), (240, 62, 62)),
    ("up", (0.0, 0.21, 0.0), (64, 192, 87)),
    ("front", (0.0, 0.0, -0.42), (51, 154, 240)),
)
_OPACITY = 0.62


def overlay_size(width: int, height: int) -> tuple[int, int]:
    """(width, height) of the overlay for a photo of that size; aspect kept."""
    scale = min(max(max(width, height), MIN_SIDE), MAX_SIDE) / max(width, height)
    return max(1, round(width * scale)), max(1, round(height * scale))


def overlay_cameras(annotation: Annotation) -> Cameras:
    """The annotation's camera at the overlay's size: render with it for the sharpest picture."""
    width, height = overlay_size(*annotation.photo_size)
    pose = _scaled(annotation.pose, _scale(annotation.photo_size))
    return pose.to_cameras(width, height)


def draw_overlay(photo: Photo, items: Sequence[tuple[Annotation, Views]]) -> Image.Image:
    """Draw every annotation over its photo.

    Args:
        photo: The photo.
        items: Each annotation with one view of its CAD model, rendered by ``overlay_cameras`` or, at the
            photo's own size, by ``annotation.pose.to_cameras(photo.width, photo.height)``.

    Returns:
        RGB picture of ``overlay_size``.

    Raises:
        ValueError: a view has neither size.
    """
    width, height = overlay_size(photo.width, photo.height)
    scale = _scale((photo.width, photo.height))
    unit = max(width, height) / 1000.0
    canvas = resized(photo.rgb, width, height).copy()

    layers = [(colour_of(i), *_layer(views, width, height), a) for i, (a, views) in enumerate(items)]
    # Large objects first, so that small ones in front of them stay visible.
    layers.sort(key=lambda layer: -int((layer[2] > 127).sum()))
    for colour, rgb, alpha, _ in layers:
        _blend(canvas, rgb, alpha, colour)
    for colour, _, alpha, _ in layers:
        outline(canvas, alpha, colour, unit)
    for colour, _, _, annotation in layers:
        rectangle(canvas, np.array(annotation.detection.box.to_tuple()) * scale, colour, unit)

    axes = [
        _axis_points(_scaled(a.pose, scale), np.array(a.detection.box.to_tuple()) * scale, canvas, unit)
        for *_, a in layers
    ]
    for points in axes:
        _axes(canvas, *points, unit)
    image = Image.fromarray(canvas)
    draw = ImageDraw.Draw(image)
    for points in axes:
        _axis_names(draw, *points, unit)
    taken: list[tuple[float, float, float, float]] = []
    for colour, _, _, annotation in reversed(layers):
        box = [value * scale for value in annotation.detection.box.to_tuple()]
        taken.append(label(draw, label_text(annotation), (box[0], box[1]), colour, unit, image.size, taken))
    return image


def _scale(size: tuple[int, int]) -> float:
    return max(overlay_size(*size)) / max(size)


def _scaled(pose: Pose4Dof, scale: float) -> Pose4Dof:
    x, y = pose.principal_px
    return Pose4Dof(pose.rotation, pose.focal_px * scale, (x * scale, y * scale), pose.t_z)


def _layer(views: Views, width: int, height: int) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The view's colour, premultiplied by its alpha, and its alpha, both at the overlay's size."""
    h, w = views.alpha.shape[1:]
    if overlay_size(w, h) != (width, height) or len(views) != 1:
        raise ValueError(
            f"an overlay of {width} x {height} needs one view of its own or the photo's size, "
            f"got {len(views)} of {w} x {h}"
        )
    alpha = views.alpha[0]
    rgb = (views.rgb[0].astype(np.uint16) * alpha[..., None] // 255).astype(np.uint8)
    return resized(rgb, width, height), resized(alpha, width, height)


def _blend(
    canvas: NDArray[np.uint8], rgb: NDArray[np.uint8], alpha: NDArray[np.uint8], colour: Colour
) -> None:
    """Mix the model in, tinted a little so that it is told from the photo."""
    rows, cols = extent(alpha, canvas.shape[:2], 0)
    a = alpha[rows, cols, None].astype(np.float32) / 255.0
    tinted = 0.85 * rgb[rows, cols].astype(np.float32) + 0.15 * a * np.array(colour, np.float32)
    mixed = canvas[rows, cols] * (1.0 - _OPACITY * a) + _OPACITY * tinted
    canvas[rows, cols] = np.clip(mixed + 0.5, 0, 255).astype(np.uint8)


def _axis_points(
    pose: Pose4Dof, box: FloatArray, canvas: NDArray[np.uint8], unit: float
) -> tuple[FloatArray, FloatArray, list[int]]:
    """Projected origin (2,), tips (3, 2), and the order in which to draw them, farthest first.

    All three are shortened alike where a tip and its name would leave the picture or the box, above
    which the label stands.
    """
    tips = np.array([tip for _, tip, _ in _AXES])
    low = np.maximum(box[:2], 0.0) + 25 * unit
    high = np.minimum(box[2:], [canvas.shape[1], canvas.shape[0]]) - 25 * unit
    for length in (1.0, 0.9, 0.8, 0.7, 0.6, 0.5):
        pixels = pose.project(np.vstack([np.zeros((1, 3)), tips * length]))
        if ((pixels >= low) & (pixels <= high)).all():
            break
    depth = tips @ pose.rotation.to_matrix()[2]
    return pixels[0], pixels[1:], [int(i) for i in np.argsort(-depth)]


def _axes(
    canvas: NDArray[np.uint8], origin: FloatArray, tips: FloatArray, order: Sequence[int], unit: float
) -> None:
    for i in order:
        along = tips[i] - origin
        length = float(np.hypot(*along))
        if length < 2 * unit:  # points at the camera: nothing to draw but the dot below
            continue
        along /= length
        across = np.array([-along[1], along[0]])
        head = min(13 * unit, 0.6 * length)
        neck = tips[i] - along * head
        barbs = np.array([tips[i], neck + across * head * 0.42, neck - across * head * 0.42])
        for grow, tone in ((2 * max(1, round(unit)), (20, 20, 20)), (0, _AXES[i][2])):
            line(canvas, np.array([origin, neck]), tone, max(2, round(2.6 * unit)) + grow)
            fixed = np.round((np.clip(barbs, -1e4, 1e4) - 0.5) * 2**SHIFT).astype(np.int32)
            if grow:
                cv2.polylines(canvas, [fixed.reshape(-1, 1, 2)], True, tone, grow, cv2.LINE_AA, SHIFT)
            cv2.fillConvexPoly(canvas, fixed, tone, cv2.LINE_AA, SHIFT)
    centre = np.round((origin - 0.5) * 2**SHIFT).astype(np.int32)
    for radius, tone in ((5.2, (20, 20, 20)), (3.8, (255, 255, 255))):
        spot = (int(centre[0]), int(centre[1]))
        cv2.circle(canvas, spot, round(radius * unit * 2**SHIFT), tone, -1, cv2.LINE_AA, SHIFT)


def _axis_names(
    draw: ImageDraw.ImageDraw, origin: FloatArray, tips: FloatArray, order: Sequence[int], unit: float
) -> None:
    size = max(13, round(12.5 * unit))
    for i in order:
        name, _, colour = _AXES[i]
        along = tips[i] - origin
        length = float(np.hypot(*along))
        if length < 8 * unit:
            continue
        x, y = tips[i] + along / length * size * 0.9
        red, green, blue = (round(0.45 * c + 0.55 * 255) for c in colour)
        light: Colour = (red, green, blue)
        stroke = max(2, round(2 * unit))
        draw.text(
            (x, y),
            name,
            fill=light,
            font=font(size),
            anchor="mm",
            stroke_width=stroke,
            stroke_fill=(15, 15, 15),
        )
