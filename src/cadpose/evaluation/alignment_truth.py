"""The labelled model of an object, from the library or from the data set's own file, and where it appears."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np
from trimesh.exchange.ply import load_ply

from cadpose.datasets.label import Label
from cadpose.errors import InputError
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.assets import read_capped
from cadpose.library.catalogue import Library
from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.loading import load_mesh_file
from cadpose.library.mesh import Mesh
from cadpose.library.normalise import normalise, rotation_from_axes
from cadpose.library.symmetry import mesh_symmetry
from cadpose.records import CadModel

#: Vertices whose places are compared.
_POINTS = 2000


@dataclass(frozen=True, eq=False)
class TrueModel:
    """A model that is placed.

    Attributes:
        id: Its id.
        mesh: Normalised.
        symmetry: The rotations that leave it as it looks.
        cad: Its catalogue entry; None where it is a data set's own file.
        file_diagonal: Length of that file's bounding box's diagonal in its own unit.
        file_centre: (3,) middle of that box in the file's unit, turned to ShapeNet's axes; None where it is
            not known.
    """

    id: str
    mesh: Mesh
    symmetry: SymmetryGroup
    cad: CadModel | None = None
    file_diagonal: float = 1.0
    file_centre: FloatArray | None = None

    @classmethod
    def of(cls, label: Label, library: Library) -> Self:
        """The label's model.

        Raises:
            InputError: the label names none, or its file cannot be used.
            LibraryError: it is not in the library.
        """
        if label.cad_path is not None:
            axes = label.cad_axes
            turn = np.eye(3) if axes is None else rotation_from_axes(*axes)
            mesh, scale = normalise(load_mesh_file(label.cad_path), turn)
            centre = _centre(label.cad_path)
            centre = None if centre is None else turn @ centre
            return cls(label.cad or str(label.cad_path), mesh, mesh_symmetry(mesh), None, 1.0 / scale, centre)
        if label.cad is None:
            raise InputError(f"{label.photo}: the label names no CAD model")
        return cls.of_library(library.get(label.cad), library)

    @classmethod
    def of_library(cls, cad: CadModel, library: Library) -> Self:
        """A model of the library."""
        return cls(cad.id, library.mesh(cad), library.symmetry(cad), cad, 1.0, np.zeros(3))

    @property
    def points(self) -> FloatArray:
        """(P, 3) vertices, spread over the mesh's list."""
        vertices = self.mesh.vertices
        return vertices[:: max(1, len(vertices) // _POINTS)].astype(np.float64)


def true_pixels(label: Label, model: TrueModel) -> FloatArray | None:
    """(P, 2) pixels at which the labelled model's points appear.

    None where the label tells no full pose, or ``model`` is not the labelled one.
    """
    K = label.K
    if K is None or label.R_cv_from_s is None or label.t_cv is None or model.file_centre is None:
        return None
    if label.cad is not None and model.id != label.cad:
        return None
    in_file = model.points * model.file_diagonal + model.file_centre
    x_cv = in_file @ np.array(label.R_cv_from_s).T + np.array(label.t_cv)
    if (x_cv[:, 2] <= 0).any():
        return None
    pixels = x_cv @ K.T
    return np.asarray(pixels[:, :2] / pixels[:, 2:])


def _centre(path: Path) -> FloatArray | None:
    """Middle of an OBJ or PLY file's bounding box in its own axes; loading moves it to the origin."""
    suffix = path.suffix.lower()
    if suffix not in (".obj", ".ply"):
        return None
    data = read_capped(path, DEFAULT_LIMITS.file_bytes)
    try:
        if suffix == ".ply":
            vertices = np.asarray(load_ply(io.BytesIO(data))["vertices"], np.float64)
        else:
            rows = [line.split()[1:4] for line in data.splitlines() if line.startswith(b"v ")]
            vertices = np.array(rows, np.float64)
    except (ValueError, KeyError):
        return None
    if vertices.ndim != 2 or vertices.shape[1:] != (3,) or not np.isfinite(vertices).all():
        return None
    return np.asarray((vertices.min(axis=0) + vertices.max(axis=0)) / 2.0)
