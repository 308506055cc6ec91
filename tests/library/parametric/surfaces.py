"""Where the parts of one look lie on a model."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.library.mesh import Mesh


def surface_of(mesh: Mesh, name: str, textured: bool = False) -> NDArray[np.float64]:
    """(N, 3) corners of the faces whose material has a name; none if there is no such material."""
    wanted = [
        i for i, m in enumerate(mesh.materials) if m.name == name and (m.texture is not None or not textured)
    ]
    faces = mesh.faces[np.isin(mesh.face_material, wanted)]
    return mesh.vertices[faces.ravel()].astype(np.float64)
