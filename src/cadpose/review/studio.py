"""Refining and measuring poses for the page, whatever else goes on."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from cadpose.alignment.placement import Placement, rectangle
from cadpose.alignment.refinement.crop import ObjectCrop
from cadpose.alignment.refinement.network import RefinementNetwork
from cadpose.alignment.refinement.refine import Refiner
from cadpose.backends import encoder_on
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof
from cadpose.records import Mask, Photo, Refinement
from cadpose.rendering.raster import Rasteriser
from cadpose.review.refusals import RefusedError

#: Seconds that a request waits for its turn.
PATIENCE = 20.0


@dataclass(frozen=True)
class Measured:
    """How well a pose agrees with what is known of the object.

    Attributes:
        box_iou: With the box.
        mask_iou: With the mask, None without one; on the pipeline's own raster of 256 pixels.
    """

    box_iou: float
    mask_iou: float | None

    def told(self) -> dict[str, float]:
        """As ``Store.decide`` takes them."""
        return {"box_iou": self.box_iou} | ({} if self.mask_iou is None else {"mask_iou": self.mask_iou})


class Studio:
    """The renderer and the refiner of the page; an annotation that runs beside has its own.

    Args:
        device: ``"cpu"`` or ``"cuda"``.
    """

    def __init__(self, device: str = "cpu") -> None:
        self.device = device
        self.renderer = Rasteriser()
        self._placement = Placement(self.renderer)
        self._measuring = threading.Lock()

    @cached_property
    def _refiner(self) -> Refiner:
        return Refiner(encoder_on(self.device), RefinementNetwork(self.device))

    def measure(self, mesh: Mesh, pose: Pose4Dof, box: Box, mask: Mask | None) -> Measured:
        """How well a pose agrees with box and mask.

        Raises:
            InputError: the model reaches behind the camera.
            RefusedError: others are being measured for too long.
        """
        with self._turn(self._measuring), _as_input():
            drawn = np.array(rectangle(pose, mesh).to_tuple())
            iou = float(box_iou(drawn, np.array(box.to_tuple())))
            return Measured(
                iou, None if mask is None else self._placement.silhouette_iou(mesh, pose, box, mask)
            )

    def snap(
        self,
        photo: Photo,
        box: Box,
        mask: Mask | None,
        mesh: Mesh,
        start: Pose4Dof,
        mode: str,
        symmetry: SymmetryGroup | None,
    ) -> tuple[Pose4Dof, Refinement]:
        """The pose near ``start`` that fits best, by the refinement of ``cadpose annotate --refine``.

        Called for one request at a time, whose turn its route waits for.

        Raises:
            InputError: the start cannot be drawn, or the box lies outside the photo.
            DependencyError: the network's weights are missing.
        """
        inside = box.clipped(photo.width, photo.height)
        if inside is None:
            raise InputError("the box lies outside the photo")
        with _as_input():
            crop = ObjectCrop.of(photo.rgb, inside, mask)
            draw = partial(self.renderer.render, mesh)
            refined = self._refiner.refine(crop, start, draw, mode, symmetry=symmetry)
        return refined.pose, refined.record

    @contextmanager
    def _turn(self, lock: threading.Lock) -> Iterator[None]:
        if not lock.acquire(timeout=PATIENCE):
            raise RefusedError("busy", "the server is busy with other poses: try again in a moment")
        try:
            yield
        finally:
            lock.release()


@contextmanager
def _as_input() -> Iterator[None]:
    """What geometry refuses is the request's fault."""
    try:
        yield
    except ValueError as error:
        raise InputError(f"this pose cannot be drawn: {error}") from None


def seconds_since(start: float) -> float:
    """Seconds since a moment of ``time.perf_counter``."""
    return round(time.perf_counter() - start, 4)
