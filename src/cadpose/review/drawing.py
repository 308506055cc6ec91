"""Pictures for the page: photos made smaller, crops with a model's outline, portraits of models."""

from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.annotations.marks import outline
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.library.mesh import Mesh
from cadpose.photos import crop_square
from cadpose.poses import Pose4Dof
from cadpose.records import Photo
from cadpose.rendering import Renderer

#: Side of the queue's thumbnails.
THUMB = 96
_CONTEXT = 1.3
_LINE = (255, 200, 0)


def photo_jpeg(photo: Photo, side: int) -> bytes:
    """The photo with its longer side at most ``side`` pixels."""
    image = Image.fromarray(photo.rgb)
    if max(image.size) > side:
        # The box filter first: from 48 megapixels the fine one alone takes seconds.
        image.thumbnail((side, side), Image.Resampling.LANCZOS, reducing_gap=2.0)
    return _jpeg(image, 90)


def object_jpeg(photo: Photo, box: Box, mesh: Mesh | None, pose: Pose4Dof, renderer: Renderer) -> bytes:
    """A square crop about the box with the model's outline where the model is at hand."""
    (cx, cy), half = box.centre, _CONTEXT * max(box.width, box.height) / 2.0
    square = Box(cx - half, cy - half, cx + half, cy + half)
    crop = np.array(crop_square(photo.rgb, square, THUMB, fill=128, context=True))
    if mesh is not None:
        scale, seen = THUMB / square.width, pose.to_cameras(THUMB, THUMB)
        cameras = replace(
            seen,
            focal_px=seen.focal_px * scale,
            principal_px=(seen.principal_px - (square.x0, square.y0)) * scale,
        )
        outline(crop, renderer.render(mesh, cameras).alpha[0], _LINE, 0.7)
    return _jpeg(Image.fromarray(crop), 85)


def portrait_png(
    mesh: Mesh, renderer: Renderer, azimuth: float, elevation: float, inplane: float, size: int
) -> bytes:
    """A model alone, framed, on nothing."""
    R = rotation_from_angles(azimuth, elevation, inplane)
    views = renderer.render(mesh, Cameras.framing(R, mesh.hull, size=size, margin=0.04))
    rgba: NDArray[np.uint8] = np.concatenate([views.rgb[0], views.alpha[0, ..., None]], axis=2)
    return png(rgba)


def missing_png(size: int = THUMB) -> bytes:
    """What stands where a picture is not at hand: a grey square with a line across."""
    grey = np.full((size, size, 3), 208, np.uint8)
    line = np.arange(size)
    grey[line, line] = grey[line, size - 1 - line] = 160
    return png(grey)


def png(pixels: NDArray[np.uint8]) -> bytes:
    """(H, W, 3 or 4) uint8 as PNG."""
    out = io.BytesIO()
    Image.fromarray(pixels).save(out, "PNG", compress_level=3)
    return out.getvalue()


def _jpeg(image: Image.Image, quality: int) -> bytes:
    out = io.BytesIO()
    image.save(out, "JPEG", quality=quality)
    return out.getvalue()
