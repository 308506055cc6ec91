"""The shadow of a model on the ground plane under it, in perspective.

The ground is the plane through the model's lowest point, its normal the model's up axis. How much light of
a direction does not reach a point of it is read from the model's silhouette as seen from that direction, as
all of the model lies above the ground. Many directions of the sky make the contact shadow, some about the
lamp's the cast one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof
from cadpose.rendering.raster import Rasteriser
from cadpose.replacement.light import Light

#: Half the side of the square of ground that is looked at, and its cells a side.
REACH, CELLS = 1.5, 384
# Silhouettes are this wide, and seen from far enough that rays are parallel.
_MAP, _FAR = 224, 60.0
_SKY, _LAMP = 40, 14
#: Half the angle that the lamp fills as seen from the ground, as a sine: windows and haze soften shadows.
LAMP_RADIUS = 0.08
# Least sine of elevation at which a ground is seen at all.
_GRAZING = 0.004


@dataclass(frozen=True, eq=False)
class GroundShadow:
    """Shares of light that do not reach the ground.

    Attributes:
        sky: (CELLS, CELLS) of the ambient light; rows run along z of the model, columns along x.
        lamp: (CELLS, CELLS) of the lamp's.
        height: y of the ground in the model's axes.
    """

    sky: FloatArray
    lamp: FloatArray
    height: float


def ground_height(mesh: Mesh) -> float:
    """y of the lowest point of a model."""
    return float(mesh.bounds[0, 1])


def ground_shadow(mesh: Mesh, lamp_s: FloatArray) -> GroundShadow:
    """What a model keeps from its ground.

    Args:
        mesh: The model, unit diagonal.
        lamp_s: (3,) unit direction to the lamp in the model's axes; below the horizon it casts nothing.
    """
    y = ground_height(mesh)
    steps = (np.arange(CELLS) + 0.5) / CELLS * 2.0 * REACH - REACH
    x, z = np.meshgrid(steps, steps)
    points = np.stack([x, np.full_like(x, y), z], axis=-1).reshape(-1, 3)
    drawer = Rasteriser(supersample=1)
    sky = _kept_away(mesh, points, _sky_directions(_SKY), drawer)
    lamp = np.zeros(len(points))
    if lamp_s[1] > 0.02:
        lamp = _kept_away(mesh, points, _cone(lamp_s, LAMP_RADIUS, _LAMP), drawer)
    shape = (CELLS, CELLS)
    # Far from the model nobody knows whether the ground goes on: a wall may stand there.
    fade = np.clip((REACH - np.hypot(x, z)) / (0.45 * REACH), 0.0, 1.0)
    fade = fade * fade * (3.0 - 2.0 * fade)
    return GroundShadow(sky.reshape(shape) * fade, lamp.reshape(shape) * fade, y)


def darkening(shadow: GroundShadow, light: Light, pose: Pose4Dof, width: int, height: int) -> FloatArray:
    """(height, width) share of light that the ground loses, in [0, 1], as the photo's camera sees it.

    Zero everywhere for a camera below the ground or level with it.
    """
    R = pose.rotation.to_matrix()
    up = R[:, 1]
    eye = -(R.T @ np.array([0.0, 0.0, pose.t_z]))
    if eye[1] - shadow.height < _GRAZING:
        return np.zeros((height, width))
    facing = max(float(up @ np.array(light.direction)), 0.0)
    whole = light.ambient + light.key * facing
    lost = (light.ambient * shadow.sky + light.key * facing * shadow.lamp) / max(whole, 1e-6)
    H = _image_from_cells(pose, shadow.height)
    warped = cv2.warpPerspective(
        lost.astype(np.float32), H, (width, height), flags=cv2.INTER_LINEAR, borderValue=0.0
    )
    seen = np.clip(np.asarray(warped, np.float64), 0.0, 1.0)
    # Behind the horizon the plane would be seen from below; warping knows no front and back.
    cx, cy = pose.principal_px
    across = up[0] * (np.arange(width) + 0.5 - cx) / pose.focal_px
    down = up[1] * (np.arange(height) + 0.5 - cy) / pose.focal_px
    seen[across[None] + down[:, None] + up[2] >= -1e-4] = 0.0
    seen[seen < 1.0 / 512.0] = 0.0
    return seen


def _image_from_cells(pose: Pose4Dof, ground: float) -> FloatArray:
    """(3, 3) homography from cells of the ground to pixels, both counted from the first centre."""
    R = pose.rotation.to_matrix()
    per_cell = 2.0 * REACH / CELLS
    start = 0.5 * per_cell - REACH
    cells = np.array([[per_cell, 0.0, start], [0.0, 0.0, ground], [0.0, per_cell, start], [0.0, 0.0, 1.0]])
    f, (cx, cy) = pose.focal_px, pose.principal_px
    K = np.array([[f, 0.0, cx - 0.5], [0.0, f, cy - 0.5], [0.0, 0.0, 1.0]])
    T = np.concatenate([R, np.array([[0.0], [0.0], [pose.t_z]])], axis=1)
    return np.asarray(K @ T @ cells)


def _kept_away(mesh: Mesh, points: FloatArray, directions: FloatArray, drawer: Rasteriser) -> FloatArray:
    """(P,) mean share of these directions in which the model hides the sky from a point."""
    frames = np.stack([_looking_along(-direction) for direction in directions])
    focal = _MAP * _FAR / 1.06
    cameras = Cameras.from_rotations(frames, focal_px=focal, width=_MAP, height=_MAP, t_z=_FAR)
    hidden = drawer.render(mesh, cameras).alpha
    total = np.zeros(len(points))
    for frame, alpha in zip(frames, hidden, strict=True):
        at = ((points @ frame[:2].T) * (focal / _FAR) + _MAP / 2.0 - 0.5).astype(np.float32)
        # As square as the ground: OpenCV refuses maps of more than 32767 rows.
        columns, rows = at.T.reshape(2, CELLS, CELLS)
        read = cv2.remap(alpha, columns, rows, cv2.INTER_LINEAR, borderValue=0)
        total += read.ravel() / 255.0
    return total / len(directions)


def _looking_along(direction: FloatArray) -> FloatArray:
    """(3, 3) rotation, object to camera, of a camera that looks along a direction of the object's axes."""
    z = direction / np.linalg.norm(direction)
    x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z])


def _sky_directions(count: int) -> FloatArray:
    """(count, 3) of the upper half, as densely as their light counts on level ground (cosine)."""
    i = np.arange(count) + 0.5
    r, turn = np.sqrt(i / count), np.pi * (1.0 + 5.0**0.5) * i
    return np.stack([r * np.cos(turn), np.sqrt(1.0 - r * r), r * np.sin(turn)], axis=1)


def _cone(axis: FloatArray, radius: float, count: int) -> FloatArray:
    """(count, 3) unit directions within an angle of sine ``radius`` about an axis, all above the ground."""
    frame = _looking_along(axis)
    i = np.arange(count) + 0.5
    r, turn = radius * np.sqrt(i / count), np.pi * (1.0 + 5.0**0.5) * i
    told = axis + (r * np.cos(turn))[:, None] * frame[0] + (r * np.sin(turn))[:, None] * frame[1]
    told[:, 1] = np.maximum(told[:, 1], 0.02)
    return np.asarray(told / np.linalg.norm(told, axis=1, keepdims=True))
