"""The overlay: the photo with its models blended in, their outlines, axes, boxes and labels."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

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
_SHIFT = 4  # fractional bits of OpenCV's coordinates


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
        _outline(canvas, alpha, colour, unit)
    for colour, _, _, annotation in layers:
        _box(canvas, np.array(annotation.detection.box.to_tuple()) * scale, colour, unit)

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
        taken.append(_label(draw, label_text(annotation), (box[0], box[1]), colour, unit, image.size, taken))
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
    rows, cols = _extent(alpha, canvas.shape[:2], 0)
    a = alpha[rows, cols, None].astype(np.float32) / 255.0
    tinted = 0.85 * rgb[rows, cols].astype(np.float32) + 0.15 * a * np.array(colour, np.float32)
    mixed = canvas[rows, cols] * (1.0 - _OPACITY * a) + _OPACITY * tinted
    canvas[rows, cols] = np.clip(mixed + 0.5, 0, 255).astype(np.uint8)


def _outline(canvas: NDArray[np.uint8], alpha: NDArray[np.uint8], colour: Colour, unit: float) -> None:
    """A line of even width along the silhouette, from a smoothed signed distance to it."""
    half = max(0.9 * unit, 0.9)
    rows, cols = _extent(alpha, canvas.shape[:2], round(6 * unit) + 4)
    inside = (alpha[rows, cols] >= 128).astype(np.uint8)
    if not inside.any():
        return
    # A border keeps an object that fills the picture finite.
    inside = np.pad(inside, 1)
    distance = cv2.distanceTransform(inside, cv2.DIST_L2, 5) - cv2.distanceTransform(
        1 - inside, cv2.DIST_L2, 5
    )
    distance = np.abs(cv2.GaussianBlur(distance, (0, 0), 0.9))[1:-1, 1:-1, None]
    region = canvas[rows, cols].astype(np.float32)
    for width, tone, strength in ((half + 1.1 * unit, (0, 0, 0), 0.45), (half, colour, 1.0)):
        cover = np.clip(width + 0.5 - distance, 0.0, 1.0) * strength
        region += cover * (np.array(tone, np.float32) - region)
    canvas[rows, cols] = np.clip(region + 0.5, 0, 255).astype(np.uint8)


def _extent(alpha: NDArray[np.uint8], size: tuple[int, ...], border: int) -> tuple[slice, slice]:
    rows, cols = np.flatnonzero(alpha.any(axis=1)), np.flatnonzero(alpha.any(axis=0))
    if not len(rows):
        return slice(0, 0), slice(0, 0)
    return (
        slice(max(0, int(rows[0]) - border), min(size[0], int(rows[-1]) + 1 + border)),
        slice(max(0, int(cols[0]) - border), min(size[1], int(cols[-1]) + 1 + border)),
    )


def _line(canvas: NDArray[np.uint8], points: FloatArray, colour: Colour, thickness: int) -> None:
    # OpenCV's integer coordinates mean pixel centres; ours are continuous.
    fixed = np.round((np.clip(points, -1e4, 1e4) - 0.5) * 2**_SHIFT).astype(np.int32)
    cv2.polylines(canvas, [fixed.reshape(-1, 1, 2)], False, colour, thickness, cv2.LINE_AA, _SHIFT)


def _box(canvas: NDArray[np.uint8], box: FloatArray, colour: Colour, unit: float) -> None:
    """A thin rectangle with stronger corners, moved inside where it lies on the picture's border."""
    inset = 1.5 * unit
    limit = np.array([canvas.shape[1], canvas.shape[0]]) - inset
    low, high = np.maximum(box[:2], inset), np.minimum(box[2:], limit)
    (x0, y0), (x1, y1) = low, high
    thin = max(1, round(unit))
    _line(canvas, np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1], [x0, y0]]), colour, thin)
    arm = min(22 * unit, 0.25 * min(x1 - x0, y1 - y0))
    for x, dx in ((x0, arm), (x1, -arm)):
        for y, dy in ((y0, arm), (y1, -arm)):
            corner = np.array([[x + dx, y], [x, y], [x, y + dy]])
            _line(canvas, corner, colour, max(2, round(3 * unit)))


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
            _line(canvas, np.array([origin, neck]), tone, max(2, round(2.6 * unit)) + grow)
            fixed = np.round((np.clip(barbs, -1e4, 1e4) - 0.5) * 2**_SHIFT).astype(np.int32)
            if grow:
                cv2.polylines(canvas, [fixed.reshape(-1, 1, 2)], True, tone, grow, cv2.LINE_AA, _SHIFT)
            cv2.fillConvexPoly(canvas, fixed, tone, cv2.LINE_AA, _SHIFT)
    centre = np.round((origin - 0.5) * 2**_SHIFT).astype(np.int32)
    for radius, tone in ((5.2, (20, 20, 20)), (3.8, (255, 255, 255))):
        spot = (int(centre[0]), int(centre[1]))
        cv2.circle(canvas, spot, round(radius * unit * 2**_SHIFT), tone, -1, cv2.LINE_AA, _SHIFT)


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


def _label(
    draw: ImageDraw.ImageDraw,
    text: str,
    corner: tuple[float, float],
    colour: Colour,
    unit: float,
    size: tuple[int, int],
    taken: Sequence[tuple[float, float, float, float]],
) -> tuple[float, float, float, float]:
    """Write the label above ``corner``, inside the picture and off other labels; its rectangle."""
    pad, face = 4.5 * unit, font(max(14, round(13.5 * unit)))
    while draw.textlength(text, font=face) + 2 * pad > size[0] and face.size > 9:
        face = font(round(face.size) - 1)
    wide = draw.textlength(text, font=face) + 2 * pad
    ascent, descent = face.getmetrics()
    high = ascent + descent + pad
    x = min(max(corner[0], 0.0), max(0.0, size[0] - wide))
    wanted = corner[1] - high - 2 * unit
    free = sorted(
        (
            y
            for y in _rows(wanted, high, size[1])
            if not any(_meet((x, y, x + wide, y + high), t) for t in taken)
        ),
        key=lambda y: abs(y - wanted),
    )
    y = free[0] if free else min(max(wanted, 0.0), size[1] - high)
    draw.rounded_rectangle((x, y, x + wide, y + high), radius=4 * unit, fill=colour)
    dark = 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 120
    ink = (0, 0, 0) if dark else (255, 255, 255)
    draw.text((x + pad, y + high / 2), text, fill=ink, font=face, anchor="lm")
    return x, y, x + wide, y + high


def _rows(wanted: float, high: float, limit: int) -> list[float]:
    last = max(0.0, limit - high)
    steps = range(int(last / high) + 1)
    return [min(max(wanted, 0.0), last), *(min(step * (high + 1), last) for step in steps)]


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
