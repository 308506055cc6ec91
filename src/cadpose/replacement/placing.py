"""Where the new model goes: the old one's rotation, standing where the old one stood."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np

from cadpose.errors import InputError
from cadpose.geometry.camera import projected_rectangle
from cadpose.library.mesh import Mesh
from cadpose.poses import Pose4Dof
from cadpose.records import CadModel
from cadpose.replacement.shadow import ground_height

#: ``match``: as large in the picture as the old model; ``real``: as the two models' sizes in centimetres say.
Size = Literal["match", "real"]
#: How much longer a side of the rectangle may become for its area's sake.
_LONGER = 1.12


def standing_pose(
    old_mesh: Mesh, old: CadModel, new_mesh: Mesh, new: CadModel, pose: Pose4Dof, size: Size = "match"
) -> Pose4Dof:
    """The pose in which the new model stands on the old one's ground.

    The rotation stays. A model that is ``s`` times as large as the old one's diagonal, and whose origin moved
    by d (camera frame), is seen as by the focal length f s t_z / (t_z + d_z) and the principal point
    O + f d_xy / (t_z + d_z); perspective is that of ``t_z`` as in every 4-DoF pose.

    Raises:
        InputError: the real sizes are asked for and one is unknown.
    """
    scale = _real_scale(old, new) if size == "real" else _matching_scale(old_mesh, new_mesh, pose)
    R = pose.rotation.to_matrix()
    d = R[:, 1] * (ground_height(old_mesh) - scale * ground_height(new_mesh))
    depth = max(pose.t_z + float(d[2]), 0.2 * pose.t_z)
    x, y = np.array(pose.principal_px) + pose.focal_px * d[:2] / depth
    placed = replace(
        pose, focal_px=pose.focal_px * scale * pose.t_z / depth, principal_px=(float(x), float(y))
    )
    # On the ground the model is still free to come nearer: its lowest row is where the old one's was, so that
    # nothing of the old place shows in front of it.
    lower = _lowest_row(old_mesh, pose) - _lowest_row(new_mesh, placed)
    return replace(placed, principal_px=(float(x), float(y) + lower))


def _lowest_row(mesh: Mesh, pose: Pose4Dof) -> float:
    rect = projected_rectangle(pose.rotation.to_matrix(), mesh.hull, t_z=pose.t_z)[0]
    return pose.principal_px[1] + pose.focal_px * float(rect[3])


def _matching_scale(old_mesh: Mesh, new_mesh: Mesh, pose: Pose4Dof) -> float:
    """Rectangles of equal area, which hides the old object best, but no side much longer than before."""
    R = pose.rotation.to_matrix()
    sides = []
    for mesh in (old_mesh, new_mesh):
        x0, y0, x1, y1 = projected_rectangle(R, mesh.hull, t_z=pose.t_z)[0]
        sides.append(np.maximum((x1 - x0, y1 - y0), 1e-6))
    ratio = sides[0] / sides[1]
    return float(min(np.sqrt(ratio.prod()), _LONGER * ratio.min()))


def _real_scale(old: CadModel, new: CadModel) -> float:
    lengths = []
    for cad in (old, new):
        length = 0.0 if cad.size_cm is None else float(np.linalg.norm(cad.size_cm))
        if not (math.isfinite(length) and length > 0):
            raise InputError(
                f"the size of {cad.name or cad.id} is unknown, so its real size cannot be kept: "
                "use --size match"
            )
        lengths.append(length)
    return lengths[1] / lengths[0]
