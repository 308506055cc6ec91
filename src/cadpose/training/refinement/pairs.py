"""Pairs of a synthetic photo's crop and the model drawn at a pose near the true one, and the way back.

A pose is off as an estimate is: the rotation by chance, focal length and offset by what the box then gives.
The drawn model is the library's; the photographed one has other proportions and colours.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from cadpose.alignment.focal import align
from cadpose.alignment.refinement.crop import BACKGROUND, ObjectCrop
from cadpose.encoder import Lite0
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import T_Z
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import rotation_about
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from cadpose.training.refinement.network import cells_of, cover_of
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.records import SynthObject

#: Poses a photo.
EACH = 3
#: Objects of which less is seen, or that are smaller in pixels, are not learned from.
LEAST_VISIBLE, LEAST_SIDE = 0.5, 56.0
#: Standard deviations in degrees of azimuth, elevation and in-plane rotation: most poses are off by a part of
#: the first, some by a part of the second.
OFF = np.array([[12.0, 6.0, 4.0], [25.0, 10.0, 7.0]])
_PART = (0.1, 1.3)
#: Beside the numbers that the generator seeds with.
_PAIRS = 5


@dataclass(frozen=True)
class Pairs:
    """M pairs.

    Attributes:
        photo: (M, 196, 112) int8 standardised stride-16 map of the crop.
        view: The same of the drawn model.
        cover: (M, 196) uint8 coverage of each cell, 255 where the model fills it.
        step: (M, 6) float32, what leads from the drawn pose to the true one.
    """

    photo: Tensor
    view: Tensor
    cover: Tensor
    step: Tensor

    def __len__(self) -> int:
        return len(self.step)

    def fields(self) -> tuple[Tensor, ...]:
        """All tensors, in the order of the attributes."""
        return self.photo, self.view, self.cover, self.step


class PairMaker:
    """Makes the pairs of photos; encoder and rasteriser are made in the process that asks first."""

    @cached_property
    def _encoder(self) -> Lite0:
        return Lite0(threads=1)

    @cached_property
    def _drawer(self) -> Rasteriser:
        return Rasteriser()

    def __call__(self, generator: SynthGenerator, numbers: Sequence[int]) -> Pairs | None:
        """The pairs of photos; None where they show nothing to learn from."""
        rows = [row for i in numbers for row in _of_photo(generator, self._encoder, self._drawer, i)]
        if not rows:
            return None
        photo, view, cover, step = (np.stack(part) for part in zip(*rows, strict=True))
        return Pairs(*(torch.from_numpy(a) for a in (photo, view, cover, step)))


Row = tuple[NDArray[np.int8], NDArray[np.int8], NDArray[np.uint8], NDArray[np.float32]]


def _of_photo(generator: SynthGenerator, encoder: Lite0, drawer: Rasteriser, index: int) -> Iterator[Row]:
    photo = generator.photo(index)
    rng = np.random.default_rng((generator.seed, _PAIRS, index))
    for shown in photo.objects[:1]:
        seen = shown.visible_box
        if shown.visible < LEAST_VISIBLE or max(seen.width, seen.height) < LEAST_SIDE:
            continue
        size = photo.rgb.shape[0]
        whole = shown.box.clipped(size, size)
        box = _jittered(whole if whole is not None and rng.random() < 0.7 else seen, rng)
        crop = ObjectCrop.of(photo.rgb, box)
        map16 = cells_of(encoder.stride16(crop.rgb[None]))[0]
        scene, _ = generator.scene(shown.cad)
        hull = scene.vertices[:: max(1, len(scene.vertices) // 1500)].astype(np.float64)
        for _ in range(EACH):
            R_cv_from_s = _near(shown.rotation.to_matrix(), rng)
            try:
                pose, _ = align(hull, Rotation.from_matrix(R_cv_from_s), box, centred=True)
            except ValueError:  # seen from its edge a flat model has no rectangle
                continue
            x, y = pose.principal_px
            dx, dy = rng.normal(0.0, 0.01, 2) * crop.square.width
            start = Pose4Dof(
                pose.rotation, pose.focal_px * float(np.exp(rng.normal(0.0, 0.03))), (x + dx, y + dy)
            )
            views = drawer.render_scene(scene, crop.cameras(start.to_cameras(1, 1)))
            view = cells_of(encoder.stride16(views.over(BACKGROUND)))[0]
            yield map16, view, cover_of(views.alpha)[0], step_between(start, shown, crop.square.width)


def step_between(start: Pose4Dof, shown: SynthObject, side: float) -> NDArray[np.float32]:
    """(6,) step that leads from a pose to that of a drawn object, modulo its symmetry."""
    R_start = start.rotation.to_matrix()
    R_true = shown.symmetry.nearest(shown.rotation.to_matrix(), R_start)
    turn = Rotation.from_matrix(R_start).error_to(Rotation.from_matrix(R_true))
    R = R_true @ R_start.T
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = float(np.linalg.norm(axis))
    vector = axis / length * np.radians(turn) if length > 1e-9 else np.zeros(3)
    focal = np.log(shown.focal_px * T_Z / (shown.t_z * start.focal_px))
    offset = np.subtract(shown.principal_px, start.principal_px) / side
    return np.concatenate([vector, [focal], offset]).astype(np.float32)


def _jittered(box: Box, rng: np.random.Generator) -> Box:
    dx0, dy0, dx1, dy1 = rng.uniform(-0.06, 0.06, 4)
    w, h = box.width, box.height
    return Box(box.x0 + dx0 * w, box.y0 + dy0 * h, box.x1 + dx1 * w, box.y1 + dy1 * h)


def _near(R_cv_from_s: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A rotation off by chance, in azimuth most."""
    off = OFF[0] if rng.random() < 0.75 else OFF[1]
    azimuth, elevation, inplane = rng.normal(size=3) * off * rng.uniform(*_PART)
    return np.asarray(
        rotation_about((0.0, 0.0, 1.0), -inplane)
        @ rotation_about((1.0, 0.0, 0.0), elevation)
        @ R_cv_from_s
        @ rotation_about((0.0, 1.0, 0.0), azimuth)
    )
