"""What the JSON document tells of a pose beside its four numbers: the real camera, and its refinement."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from cadpose.annotations.parts import Matrix3, Part, PosePart, Positive, Row3, plain_text
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation
from cadpose.records import Refinement

#: ``ratio``: only f / t_z was seen, t_z is a convention. ``scale``: the camera is known, so t is in model
#: diagonals. ``metric``: the model's size is known too, so t is in metres.
Depth = Literal["ratio", "scale", "metric"]


class CameraPart(Part):
    """The camera that took the photo, and who told its focal length."""

    focal_px: Positive
    principal_px: tuple[float, float]
    source: Literal["given", "exif"]


class Pose6DofPart(Part):
    """The pose in the camera that took the photo: p ~ K (R_cv_from_s X + t_cv), X in model diagonals."""

    R_cv_from_s: Matrix3
    t_cv: Row3
    camera: CameraPart
    diagonal_m: Positive | None
    t_m: Row3 | None

    @model_validator(mode="after")
    def _metres_are_diagonals_times_their_length(self) -> Self:
        self.pose()  # refuses what is no rotation
        if (self.t_m is None) != (self.diagonal_m is None):
            raise ValueError("t_m is known if and only if diagonal_m is")
        if self.t_m is not None and self.diagonal_m is not None:
            metres = np.array(self.t_cv) * self.diagonal_m
            if not np.allclose(metres, self.t_m, rtol=1e-9, atol=0.0):
                raise ValueError("t_m is not t_cv times diagonal_m")
        return self

    @classmethod
    def of(cls, pose: Pose6Dof) -> Pose6DofPart:
        """From the record."""
        rows: list[Row3] = [_row3(row) for row in pose.R_cv_from_s.tolist()]
        camera, length = pose.camera, pose.diagonal_m
        x, y = camera.principal_px
        return cls(
            R_cv_from_s=(rows[0], rows[1], rows[2]),
            t_cv=_row3(pose.t_cv.tolist()),
            camera=CameraPart(
                focal_px=float(camera.focal_px), principal_px=(float(x), float(y)), source=camera.source
            ),
            diagonal_m=None if length is None else float(length),
            t_m=None if length is None else _row3((pose.t_cv * length).tolist()),
        )

    def pose(self) -> Pose6Dof:
        """To the record."""
        camera = PhotoCamera(self.camera.focal_px, self.camera.principal_px, self.camera.source)
        return Pose6Dof(np.array(self.R_cv_from_s), np.array(self.t_cv), camera, self.diagonal_m)


class RefinementPart(Part):
    """What render-and-compare changed: the pose before it, and the scores of both."""

    mode: str
    start: PosePart
    start_score: float
    score: float
    evaluations: Annotated[int, Field(ge=0)]
    # Documents of earlier versions lack it.
    expected_error: Annotated[float, Field(ge=0.0, le=180.0)] | None = None

    @model_validator(mode="after")
    def _never_worse(self) -> Self:
        self.record()
        return self

    @classmethod
    def of(cls, refinement: Refinement) -> RefinementPart:
        """From the record."""
        return cls(
            mode=plain_text(refinement.mode),
            start=PosePart.of_pose(refinement.start),
            start_score=float(refinement.start_score),
            score=float(refinement.score),
            evaluations=int(refinement.evaluations),
            expected_error=None if refinement.expected_error is None else float(refinement.expected_error),
        )

    def record(self) -> Refinement:
        """To the record."""
        return Refinement(
            self.mode,
            self.start.pose(),
            self.start_score,
            self.score,
            self.evaluations,
            self.expected_error,
        )


def depth_of(pose: Pose6Dof | Pose6DofPart | None) -> Depth:
    """What a pose in the real camera, or its absence, says of the distance."""
    if pose is None:
        return "ratio"
    return "scale" if pose.diagonal_m is None else "metric"


def pose_json(pose: Pose4Dof) -> dict[str, Any]:
    """A pose as it is kept with decisions and told to other programs: its numbers, without the matrices."""
    rotation, (x, y) = pose.rotation, pose.principal_px
    return {
        "azimuth": rotation.azimuth,
        "elevation": rotation.elevation,
        "inplane": rotation.inplane,
        "focal_px": float(pose.focal_px),
        "principal_px": [float(x), float(y)],
        "t_z": float(pose.t_z),
    }


def pose_of(data: Mapping[str, Any]) -> Pose4Dof:
    """Back from JSON, with or without the matrices."""
    x, y = data["principal_px"]
    rotation = Rotation(data["azimuth"], data["elevation"], data["inplane"])
    return Pose4Dof(rotation, data["focal_px"], (x, y), data["t_z"])


def _row3(values: list[float]) -> Row3:
    x, y, z = (float(value) for value in values)
    return x, y, z
