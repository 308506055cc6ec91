"""Photos whose light, object and ground are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.records import Annotation, CadModel, Candidate, Detection, Mask, Photo, Pose4Dof, Rotation
from tests.small_library import Shot, shoot

CAR, VAN, CHAIR = "car/hatch.obj", "car/van.glb", "chair/plain.obj"


def cad_id(library: Library, name: str) -> str:
    """The id that ends in a file name."""
    return next(model.id for model in library.models() if model.id.endswith(name))


@dataclass(frozen=True, eq=False)
class Street:
    """A photo of the small library's hatchback, and its exact annotation."""

    shot: Shot
    annotation: Annotation

    @property
    def photo(self) -> Photo:
        return self.shot.photo


def street(library: Library, mask: Mask | None = None) -> Street:
    shot = shoot(library, cad_id(library, CAR), Rotation(40.0, 14.0))
    return Street(shot, annotated(shot.photo, shot.cad, shot.mask if mask is None else mask, shot))


def annotated(photo: Photo, cad: CadModel, mask: Mask | None, shot: Shot) -> Annotation:
    pose = Pose4Dof(shot.rotation, shot.focal_px, (210.0, 140.0))
    return Annotation(
        photo_name=photo.name,
        photo_sha256=photo.sha256,
        photo_size=(photo.width, photo.height),
        detection=Detection(shot.box, cad.category, mask=mask),
        pose=pose,
        candidates=(Candidate(cad, 1.0, shot.rotation),),
        hypotheses=(),
        box_iou=1.0,
    )


class SmearInpainter:
    """Fills with the mean of what is known: quick, and seen at once."""

    name = "mean"

    def fill(self, rgb: NDArray[np.uint8], hole: Mask, barred: Mask) -> NDArray[np.uint8]:
        out = rgb.copy()
        out[hole] = rgb[~hole & ~barred].mean(axis=0)
        return out


def degrees_between(a: object, b: object) -> float:
    u, v = np.asarray(a, np.float64), np.asarray(b, np.float64)
    return float(np.degrees(np.arccos(np.clip(u @ v / np.linalg.norm(u) / np.linalg.norm(v), -1, 1))))


def unit(vector: object) -> FloatArray:
    v = np.asarray(vector, np.float64)
    return np.asarray(v / np.linalg.norm(v))


class OneMesh:
    """A library of meshes by id."""

    def __init__(self, **meshes: Mesh) -> None:
        self.meshes = meshes

    def get(self, cad_id: str) -> CadModel:
        return CadModel(cad_id, cad_id, "thing")

    def mesh(self, cad: CadModel | str) -> Mesh:
        return self.meshes[cad if isinstance(cad, str) else cad.id]
