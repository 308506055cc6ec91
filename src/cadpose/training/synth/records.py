"""What a synthetic photo is: the picture and what is true of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.records import Mask, Rotation

#: An object of which more than this share is hidden counts as occluded.
OCCLUDED_FROM = 0.05


@dataclass(frozen=True, eq=False)
class SynthObject:
    """One object of a synthetic photo. The camera looks at the object, as the 4-DoF annotation has it.

    Attributes:
        cad: Library id of the model that the shape was made from.
        category: Library category.
        rotation: The three angles, exact.
        focal_px: Focal length in pixels of the photo.
        principal_px: (x, y) where the object's origin appears.
        t_z: Distance of the object's origin in model diagonals.
        box: Rectangle of the whole object, also where it is hidden or outside the photo.
        visible_box: Rectangle of what is seen of it.
        mask: (H, W) bool, what is seen of it.
        visible: Share of the object that is seen, in [0, 1]: neither hidden nor outside the photo.
        hidden: Share of its pixels in the photo that other things hide, in [0, 1].
        truncated: Whether the photo's border cuts it off.
        symmetry: The rotations that leave the shape as it looks.
    """

    cad: str
    category: str
    rotation: Rotation
    focal_px: float
    principal_px: tuple[float, float]
    t_z: float
    box: Box
    visible_box: Box
    mask: Mask
    visible: float
    hidden: float
    truncated: bool
    symmetry: SymmetryGroup

    @property
    def occluded(self) -> bool:
        """Whether other things hide a part of it worth speaking of."""
        return self.hidden > OCCLUDED_FROM

    @property
    def K(self) -> FloatArray:
        """(3, 3) intrinsics of the camera that looks at this object."""
        (cx, cy), f = self.principal_px, self.focal_px
        return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


@dataclass(frozen=True, eq=False)
class SynthPhoto:
    """A synthetic photo.

    Attributes:
        index: Its number; with the seed it decides everything.
        rgb: (H, W, 3) uint8.
        objects: The main object first; those of which too little is seen are left out.
    """

    index: int
    rgb: NDArray[np.uint8]
    objects: tuple[SynthObject, ...]
