"""From a rotation and a model to where it stands in the photo: focal length, refinement, the real camera."""

from __future__ import annotations

import logging
from dataclasses import dataclass
from functools import partial

import numpy as np

from cadpose.alignment.focal import align
from cadpose.alignment.refinement.crop import ObjectCrop
from cadpose.alignment.refinement.refine import MODES, Refiner
from cadpose.alignment.refinement.steps import in_photo_camera
from cadpose.alignment.silhouette import focal_from_mask
from cadpose.geometry.boxes import Box, box_iou, mask_iou
from cadpose.geometry.camera import Cameras
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.mesh import Mesh
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation
from cadpose.records import Mask, Photo, Refinement
from cadpose.rendering import Renderer

log = logging.getLogger(__name__)

#: Ways to fit the focal length.
ALIGNMENTS = ("box", "paper", "mask")
#: Side of the raster on which silhouettes are compared with masks.
_MASK_SIDE = 256


@dataclass(frozen=True, eq=False)
class Placed:
    """A model in a photo.

    Attributes:
        pose: The four degrees of freedom.
        box_iou: IoU of the projected model's rectangle and the box.
        mask_iou: IoU of silhouette and mask, None without a mask.
        refinement: What refinement changed, None where it was off.
        pose_6dof: In the camera that took the photo, None where that is unknown.
    """

    pose: Pose4Dof
    box_iou: float
    mask_iou: float | None
    refinement: Refinement | None = None
    pose_6dof: Pose6Dof | None = None


class Placement:
    """Places models.

    Args:
        renderer: Draws them.
        align_to: What the focal length is fitted to, one of :data:`ALIGNMENTS`; see docs/alignment.md. What
            is fitted as in the paper is never refined.
        refiner: Refines; None only where ``refine`` is ``"off"``.
        refine: One of :data:`cadpose.alignment.refinement.refine.MODES`.

    Raises:
        ValueError: a word is none of these.
    """

    def __init__(
        self, renderer: Renderer, align_to: str = "box", refiner: Refiner | None = None, refine: str = "off"
    ) -> None:
        if align_to not in ALIGNMENTS:
            raise ValueError(f"align_to must be one of {', '.join(ALIGNMENTS)}, got {align_to!r}")
        if refine not in MODES:
            raise ValueError(f"refine must be one of {', '.join(MODES)}, got {refine!r}")
        if refine != "off" and refiner is None:
            raise ValueError(f"refine {refine!r} needs a refiner")
        self.renderer, self.align_to, self.refiner, self.refine = renderer, align_to, refiner, refine

    def place(
        self,
        photo: Photo,
        box: Box,
        mask: Mask | None,
        mesh: Mesh,
        rotation: Rotation,
        *,
        symmetry: SymmetryGroup | None = None,
        turn: bool = True,
        camera: PhotoCamera | None = None,
        diagonal_m: float | None = None,
    ) -> Placed:
        """A model whose rotation is known, or nearly so where it is refined.

        Args:
            photo: The photo.
            box: The object's rectangle in pixels, inside the photo.
            mask: (H, W) bool of the photo's size.
            mesh: The model.
            rotation: The three angles.
            symmetry: Of the model, for refinement.
            turn: Whether refinement may change the rotation.
            camera: The camera that took the photo, if known.
            diagonal_m: The model's diagonal in metres, if known.

        Raises:
            ValueError: the model reaches behind the camera or projects to a point.
        """
        pose = self.fit(box, mask, mesh, rotation)
        changed, whole = None, None
        if camera is not None:
            whole = _before(Pose6Dof.from_4dof(pose, camera, diagonal_m), mesh)
            if whole is None:
                log.warning(
                    "%s: a focal length of %.0f px puts the camera inside the object: no distance is told",
                    photo.name,
                    camera.focal_px,
                )
        if self.refine != "off" and self.refiner is not None and self.align_to != "paper":
            crop = ObjectCrop.of(photo.rgb, box, mask)
            refine = partial(self.refiner.refine, crop, render=partial(self.renderer.render, mesh), turn=turn)
            refined = refine(pose, mode=self.refine, symmetry=symmetry)
            pose, changed = refined.pose, refined.record
            if camera is not None and whole is not None:
                # Perspective differs from that at two diagonals: the real camera's pose is one of its own.
                own = refine(pose, mode=self.refine, symmetry=symmetry, seen=in_photo_camera(camera))
                whole = _before(Pose6Dof.from_4dof(own.pose, camera, diagonal_m), mesh)
        drawn = np.array(rectangle(pose, mesh).to_tuple())
        return Placed(
            pose,
            float(box_iou(drawn, np.array(box.to_tuple()))),
            None if mask is None else self.silhouette_iou(mesh, pose, box, mask),
            changed,
            whole,
        )

    def fit(self, box: Box, mask: Mask | None, mesh: Mesh, rotation: Rotation) -> Pose4Dof:
        """Focal length and principal point at a rotation.

        Raises:
            ValueError: as :meth:`place`.
        """
        if self.align_to == "mask" and mask is not None:
            camera = Cameras.framing(rotation.to_matrix(), mesh.hull, size=_MASK_SIDE, margin=0.02)
            silhouette = self.renderer.render(mesh, camera)
            fit = focal_from_mask(silhouette.alpha[0], camera, mask, centred=True)
            return Pose4Dof(rotation, fit.focal_px, fit.principal_px)
        return align(mesh.hull, rotation, box, centred=self.align_to != "paper")[0]

    def silhouette_iou(self, mesh: Mesh, pose: Pose4Dof | Pose6Dof, box: Box, mask: Mask) -> float:
        """Silhouette IoU on a raster around model and mask: large photos cost no more than small ones."""
        drawn = rectangle(pose, mesh)
        frame = Box.around(box, drawn, Box.from_mask(mask)) if mask.any() else Box.around(box, drawn)
        scale = _MASK_SIDE / max(frame.width, frame.height)
        width, height = max(1, round(frame.width * scale)), max(1, round(frame.height * scale))
        seen = pose.to_cameras(1, 1)
        cameras = Cameras(
            seen.R_cv_from_s,
            seen.t_cv,
            seen.focal_px * scale,
            (seen.principal_px - (frame.x0, frame.y0)) * scale,
            width,
            height,
        )
        silhouette = self.renderer.render(mesh, cameras).mask[0]
        columns = np.floor(frame.x0 + (np.arange(width) + 0.5) / scale).astype(int)
        rows = np.floor(frame.y0 + (np.arange(height) + 0.5) / scale).astype(int)
        inside = ((rows >= 0) & (rows < mask.shape[0]))[:, None] & (columns >= 0) & (columns < mask.shape[1])
        given = mask[rows.clip(0, mask.shape[0] - 1)[:, None], columns.clip(0, mask.shape[1] - 1)] & inside
        # Beyond the photo nothing is known: what the model covers there does not count.
        return mask_iou(silhouette & inside, given)


def _before(pose: Pose6Dof, mesh: Mesh) -> Pose6Dof | None:
    """The pose, or None where a part of the model lies at or behind the camera."""
    return pose if np.isfinite(pose.project(mesh.hull)).all() else None


def rectangle(pose: Pose4Dof | Pose6Dof, mesh: Mesh) -> Box:
    """Rectangle of the projected model in pixels of the photo."""
    pixels = pose.project(mesh.hull)
    (x0, y0), (x1, y1) = pixels.min(axis=0), pixels.max(axis=0)
    return Box(float(x0), float(y0), float(x1), float(y1))
