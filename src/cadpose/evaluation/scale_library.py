"""A library as large as one likes for measuring: real models and warped copies, made as they are drawn."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from threading import Lock

import numpy as np

from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.library.storage import sha256_of
from cadpose.records import CadModel
from cadpose.rendering.scene import Scene
from cadpose.similarity.index.segments import Entry
from cadpose.training.synth.shapes import KeptScenes, warped

#: Memory for models of which further copies are drawn soon.
_KEPT_BYTES = 256 * 2**20


class WarpedSource:
    """The first ``count`` of: every model, then every model warped once, once more, and so on.

    No mesh is written: a copy is warped when it is drawn, the same each time. Smaller sources are part of
    larger ones.

    Args:
        library: The real models.
        count: How many models there are to be.
        seed: Of the warps.
        symmetry: Gives the rotations that leave a model as it looks; the library's unless told.

    Raises:
        ValueError: ``count`` is below 1.
    """

    def __init__(
        self,
        library: Library,
        count: int,
        seed: int = 0,
        symmetry: Callable[[CadModel], SymmetryGroup] | None = None,
    ) -> None:
        if count < 1:
            raise ValueError(f"count must be at least 1, got {count}")
        self._models = library.models()
        self._count, self._seed = count, seed
        self._scenes = KeptScenes(library.mesh, symmetry or library.symmetry, _KEPT_BYTES)
        self._lock = Lock()
        self._made: dict[str, tuple[CadModel, int]] = {}
        for number in range(count):
            copy, place = divmod(number, len(self._models))
            cad = self._models[place]
            # Copies of one model follow one another in order of id, so its mesh is read once.
            self._made[f"{cad.id}#{copy:04d}"] = (cad, copy)

    def entries(self) -> Sequence[Entry]:
        """Every model; the copy numbered 0 is the model itself."""
        return [
            Entry(name, cad.category, sha256_of(f"{cad.sha256}/{copy}/{self._seed}".encode()))
            for name, (cad, copy) in self._made.items()
        ]

    def scene(self, entry: Entry) -> Scene:
        """A model or a warped copy, as it is drawn."""
        cad, copy = self._made[entry.id]
        with self._lock:
            scene, symmetry = self._scenes.of(cad)
        if copy == 0:
            return scene
        return warped(scene, symmetry, np.random.default_rng((self._seed, copy, zlib.crc32(cad.id.encode()))))
