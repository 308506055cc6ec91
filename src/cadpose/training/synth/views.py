"""How a shape is looked at and lit: random rotations, cameras and lights."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.rendering.lights import Lights
from cadpose.training.synth.kernels import extent
from cadpose.training.synth.options import Range


def random_angles(rng: np.random.Generator) -> tuple[float, float, float]:
    """Azimuth, elevation and in-plane rotation as people take photos: any side, mostly level and upright."""
    kind = rng.random()
    if kind < 0.6:
        elevation = rng.normal(10.0, 9.0)
    elif kind < 0.9:
        elevation = rng.uniform(-8.0, 45.0)
    else:
        elevation = rng.uniform(-25.0, 80.0)
    kind = rng.random()
    if kind < 0.65:
        inplane = rng.normal(0.0, 3.0)
    elif kind < 0.85:
        inplane = rng.normal(0.0, 10.0)
    else:
        inplane = rng.uniform(-40.0, 40.0)
    return float(rng.uniform(0.0, 360.0)), float(np.clip(elevation, -30.0, 85.0)), float(inplane)


def random_rotation(rng: np.random.Generator) -> FloatArray:
    """(3, 3) ``R_cv_from_s`` of :func:`random_angles`."""
    return rotation_from_angles(*random_angles(rng))


def random_distance(rng: np.random.Generator, between: Range) -> float:
    """t_z in model diagonals, even on a logarithmic scale."""
    low, high = np.log(between)
    return float(np.exp(rng.uniform(low, high)))


def camera_on(
    R_cv_from_s: FloatArray,
    coordinates: NDArray[np.float32],
    *,
    longer_px: float,
    centre_px: tuple[float, float],
    t_z: float,
    size: int,
) -> tuple[Cameras, FloatArray]:
    """A camera that looks at the object, and the object's rectangle (x0, y0, x1, y1) in the photo.

    Args:
        R_cv_from_s: (3, 3) rotation.
        coordinates: (3, V) x, y and z of the shape's vertices.
        longer_px: Longer side of the rectangle.
        centre_px: Its middle.
        t_z: Distance of the object's origin.
        size: Side of the photo.
    """
    # The shape lies within 0.5 of its origin, and the camera is farther off.
    rect = np.array(extent(coordinates, np.asarray(R_cv_from_s, np.float64), t_z))
    focal = longer_px / max(rect[2] - rect[0], rect[3] - rect[1])
    middle = (rect[:2] + rect[2:]) / 2.0
    principal = np.asarray(centre_px) - focal * middle
    camera = Cameras.from_rotations(
        R_cv_from_s, focal_px=focal, principal_px=principal, width=size, height=size, t_z=t_z
    )
    return camera, rect * focal + np.tile(principal, 2)


def random_lights(rng: np.random.Generator) -> Lights:
    """Light from above or a side, soft or hard, weak or strong."""
    key = rng.normal(size=3)
    key[1] = -abs(key[1]) - 0.15
    key[2] = -abs(key[2]) if rng.random() < 0.8 else key[2]
    fill = rng.normal(size=3)
    fill[2] = -abs(fill[2])
    key, fill = key / np.linalg.norm(key), fill / np.linalg.norm(fill)
    ambient = rng.uniform(0.12, 0.55)
    return Lights(
        key=(float(key[0]), float(key[1]), float(key[2])),
        key_strength=float(rng.uniform(0.15, 1.0)),
        fill=(float(fill[0]), float(fill[1]), float(fill[2])),
        fill_strength=float(rng.uniform(0.0, 0.4)),
        ambient=float(ambient),
        sky=float(rng.uniform(0.0, min(0.2, ambient))),
    )
