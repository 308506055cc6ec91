"""A textured model, photos and annotations for the tests of scenes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.errors import LibraryError
from cadpose.geometry.boxes import Box
from cadpose.library.mesh import Material, Mesh
from cadpose.records import Annotation, CadModel, Candidate, Photo, Pose4Dof, Rotation
from tests.annotations.factory import make_annotation, make_cad, make_photo


def checks(height: int = 64, width: int = 96) -> NDArray[np.uint8]:
    """A texture that shows when it is mirrored or turned: red to the left, a blue foot, a green stripe."""
    image = np.full((height, width, 3), 230, np.uint8)
    image[:, : width // 3] = (200, 30, 30)
    image[-height // 4 :] = (30, 40, 210)
    image[: height // 8] = (30, 180, 60)
    return image


def holes() -> NDArray[np.uint8]:
    """A texture that is cut out at half opacity."""
    image = np.dstack([checks(32, 32), np.full((32, 32), 255, np.uint8)])
    image[8:24, 8:24, 3] = 0
    return image


MATERIALS = (
    Material((1.0, 1.0, 1.0, 1.0), checks(), "painted"),
    Material((0.5, 0.25, 0.75, 1.0), None, "plain"),
    Material((0.2, 0.6, 0.9, 0.4), None, "glass"),
    Material((1.0, 1.0, 1.0, 1.0), holes(), "lattice"),
    Material((1.0, 1.0, 1.0, 0.0), None, "nothing"),
)


def block(materials: Sequence[int] = (0, 1, 2, 3, 0, 4)) -> Mesh:
    """A long block of unit diagonal, one material a side: -x, +x, -y, +y, -z, +z; no side is like another."""
    half = np.array([0.15, 0.2, 0.43])
    half *= 0.5 / np.linalg.norm(half)
    vertices, faces, normals, uv, numbers = [], [], [], [], []
    for side in range(6):
        axis, sign = side // 2, 2 * (side % 2) - 1
        u, v = [a for a in range(3) if a != axis]
        corners = []
        for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
            corner = np.zeros(3)
            corner[axis], corner[u], corner[v] = sign, a, b
            corners.append(corner * half)
        quad = np.array(corners)
        normal = np.eye(3)[axis] * sign
        if np.cross(quad[1] - quad[0], quad[2] - quad[0]) @ normal < 0:
            quad = quad[::-1]
        at = 4 * side
        vertices += list(quad)
        for triangle in ((0, 1, 2), (0, 2, 3)):
            faces.append([at + i for i in triangle])
            normals.append([normal] * 3)
            uv.append([((0, 0), (1, 0), (1, 1), (0, 1))[i] for i in triangle])
            numbers.append(materials[side])
    return Mesh(
        vertices=np.array(vertices, np.float32),
        faces=np.array(faces, np.int32),
        corner_normals=np.array(normals, np.float32),
        corner_uv=np.array(uv, np.float32),
        face_material=np.array(numbers, np.int32),
        materials=MATERIALS,
    )


@dataclass(frozen=True, eq=False)
class Shelf:
    """A library in memory."""

    models: dict[str, tuple[CadModel, Mesh]]

    def get(self, cad_id: str) -> CadModel:
        if cad_id not in self.models:
            raise LibraryError(f"There is no CAD model {cad_id!r} in the library.")
        return self.models[cad_id][0]

    def mesh(self, cad: CadModel | str) -> Mesh:
        return self.models[cad if isinstance(cad, str) else cad.id][1]


BLOCK = make_cad(1, name="Long block", size_cm=(30.0, 86.0, 40.0))
OTHER = make_cad(2, name="Öther", creator="", licence="CC0-1.0", size_cm=None, sha256="cd" * 32)
SHELF = Shelf({BLOCK.id: (BLOCK, block()), OTHER.id: (OTHER, block((1, 0, 0, 2, 3, 1)))})

POSES = (
    Pose4Dof(Rotation(40.0, 20.0, 10.0), 90.0, (35.0, 30.5)),
    Pose4Dof(Rotation(200.0, -15.0, -70.0), 45.0, (95.25, 55.0)),
    Pose4Dof(Rotation(310.0, 75.0, 170.0), 60.0, (70.0, 20.0)),
)


def annotated(
    photo: Photo, cads: Sequence[CadModel] = (BLOCK, OTHER, BLOCK), poses: Sequence[Pose4Dof] = POSES
) -> list[Annotation]:
    """One annotation a model and pose."""
    made = []
    for cad, pose in zip(cads, poses, strict=True):
        annotation = make_annotation(photo, box=Box(5.0, 5.0, 60.0, 60.0), pose=pose)
        first = Candidate(cad, 0.5, pose.rotation)
        made.append(replace(annotation, candidates=(first,), pose_6dof=None))
    return made


def street(width: int = 120, height: int = 80) -> tuple[Photo, AnnotationDocument]:
    """A photo with three objects of two models."""
    photo = make_photo("/home/someone/photos/stréet 1.jpg", width, height)
    return photo, document_from(photo, annotated(photo))
