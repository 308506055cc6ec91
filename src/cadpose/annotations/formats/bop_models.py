"""The models of a BOP data set: PLY files in millimetres, z up, and ``models_info.json``."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.annotations.formats.json_stream import dumped
from cadpose.annotations.formats.ply import ply_bytes
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.parts import CadPart
from cadpose.geometry.frames import FloatArray, R_b_from_s, R_s_from_b
from cadpose.geometry.symmetry import SymmetryGroup
from cadpose.library.mesh import Mesh

#: Length of a model's bounding-box diagonal where its size is not known.
UNKNOWN_DIAGONAL_MM = 1000.0


@dataclass(eq=False)
class BopModels:
    """Writes each model when it is first asked for, and the table of them at the end.

    Attributes:
        folder: Where they go.
        sources: Gives the meshes.
    """

    folder: Path
    sources: Sources
    _numbers: dict[str, int] = field(default_factory=dict, init=False)
    _info: dict[str, Any] = field(default_factory=dict, init=False)

    def number(self, cad: CadPart) -> int:
        """The model's ``obj_id``, counted from 1.

        Raises:
            LibraryError: the library lacks the model.
            InputError: the library's model is another one.
        """
        known = self._numbers.get(cad.id)
        if known is not None:
            return known
        mesh = self.sources.mesh(cad)
        number = self._numbers[cad.id] = len(self._numbers) + 1
        length = diagonal_mm(cad)
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / f"obj_{number:06d}.ply").write_bytes(ply_bytes(mesh, length, R_b_from_s))
        self._info[str(number)] = {
            **_extent(mesh, length),
            **_symmetries(self.sources.library.symmetry(cad.id)),
            "cad_id": cad.id,
            "name": cad.name,
            "category": cad.category,
            "licence": cad.licence,
            "creator": cad.creator,
            "source": cad.source,
            "sha256": cad.sha256,
            "diagonal_mm": length,
            "metric": cad.size_cm is not None,
        }
        return number

    def finish(self) -> None:
        """Write ``models_info.json``."""
        self.folder.mkdir(parents=True, exist_ok=True)
        lines = ",\n".join(f'  "{number}": {dumped(info)}' for number, info in self._info.items())
        (self.folder / "models_info.json").write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")


def diagonal_mm(cad: CadPart) -> float:
    """Length of the model's bounding-box diagonal in millimetres, 1000 where its size is not known."""
    if cad.size_cm is None or not all(np.isfinite(side) and side > 0 for side in cad.size_cm):
        return UNKNOWN_DIAGONAL_MM
    return 10.0 * float(np.linalg.norm(cad.size_cm))


def _extent(mesh: Mesh, length: float) -> dict[str, float]:
    hull = mesh.hull @ R_b_from_s.T * length
    low, high = hull.min(axis=0), hull.max(axis=0)
    told = {"diameter": _diameter(hull)}
    for axis, name in enumerate("xyz"):
        told[f"min_{name}"] = float(low[axis])
        told[f"size_{name}"] = float(high[axis] - low[axis])
    return told


def _diameter(points: FloatArray) -> float:
    """The largest distance between any two of them."""
    longest = 0.0
    square = (points**2).sum(axis=1)
    for start in range(0, len(points), 512):
        some = slice(start, start + 512)
        apart = square[some, None] + square - 2.0 * points[some] @ points.T
        longest = max(longest, float(apart.max()))
    return float(np.sqrt(longest))


def _symmetries(group: SymmetryGroup) -> dict[str, Any]:
    """BOP's ``symmetries_discrete`` ((4, 4), row by row) and ``symmetries_continuous``."""
    told: dict[str, Any] = {}
    if group.every:
        # BOP knows axes only; two of them span every rotation.
        axes = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
        return {"symmetries_continuous": [{"axis": axis, "offset": [0.0, 0.0, 0.0]} for axis in axes]}
    if group.axis is not None:
        axis = (R_b_from_s @ group.axis).tolist()
        told["symmetries_continuous"] = [{"axis": axis, "offset": [0.0, 0.0, 0.0]}]
    if len(group.rotations) > 1:
        turns = []
        for rotation in group.rotations[1:]:
            matrix = np.eye(4)
            matrix[:3, :3] = R_b_from_s @ rotation @ R_s_from_b
            turns.append(matrix.ravel().tolist())
        told["symmetries_discrete"] = turns
    return told
