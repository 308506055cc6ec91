"""Template galleries: what the encoder sees of one CAD model from every rotation of the grid.

Galleries are made once a model and cached on disk; the file's name holds everything they depend on.
"""

from __future__ import annotations

import hashlib
import logging
import os
import tempfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.encoder import Lite0
from cadpose.geometry.frames import FloatArray
from cadpose.records import CadModel, Views
from cadpose.rotation.features import LEVELS, Described, describe
from cadpose.rotation.grid import GRID_VERSION, grid_rotations
from cadpose.weights import REGISTRY

log = logging.getLogger(__name__)

#: Draws a model at (N, 3, 3) rotations, framed so that its longer side fills a 224 px square.
RenderFramed = Callable[[CadModel, FloatArray], Views]

#: Grey level behind the renders.
BACKGROUND = 255
#: Part of the cache key: change it when templates are made in another way.
FORMAT_VERSION = 2


class GalleryStore:
    """Makes galleries and keeps them on disk.

    Args:
        folder: Cache folder; made when needed.
        encoder: The Lite0 encoder.
        render: Draws a model at given rotations.
        renderer_name: Part of the cache key.
        workers: Threads that draw and encode; give the encoder one thread then. The renderer must allow it.
    """

    def __init__(
        self, folder: Path, encoder: Lite0, render: RenderFramed, renderer_name: str, workers: int = 1
    ) -> None:
        self.folder = folder
        self.encoder = encoder
        self.render = render
        self.renderer_name = renderer_name
        self.workers = workers

    def get(self, cad: CadModel) -> Described:
        """The model's templates at the rotations of the grid, from the cache or made now."""
        path = self.path(cad)
        if path.is_file():
            try:
                return _read(path)
            except Exception as error:  # a damaged zip raises nearly anything
                log.warning("the cached gallery %s is damaged and made again (%s)", path, error)
        gallery = self._made(cad)
        try:
            self._write(path, gallery)
        except OSError as error:
            # Without a cache the work is slower, not wrong.
            log.warning("the gallery of %s cannot be kept in %s (%s)", cad.id, self.folder, error)
        return gallery

    def _made(self, cad: CadModel) -> Described:
        # A thread a core draws and encodes its share: neither holds the GIL, and small networks gain
        # little from several threads within one image.
        shares = np.array_split(grid_rotations(), self.workers * 4)
        with ThreadPoolExecutor(self.workers) as pool:
            return Described.joined(list(pool.map(lambda R: self._described(cad, R), shares)))

    def _described(self, cad: CadModel, R_cv_from_s: FloatArray) -> Described:
        views = self.render(cad, R_cv_from_s)
        return describe(self.encoder, views.over(BACKGROUND), views.alpha)

    def path(self, cad: CadModel) -> Path:
        """Where the model's gallery is cached."""
        key = f"{FORMAT_VERSION}/{GRID_VERSION}/{_made_with()}/{self.renderer_name}/{cad.id}/{cad.sha256}"
        return self.folder / f"{hashlib.sha256(key.encode()).hexdigest()[:32]}.npz"

    def _write(self, path: Path, gallery: Described) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        arrays: dict[str, NDArray[Any]] = {
            f"cells_{level.name}": a for level, a in zip(LEVELS, gallery.cells, strict=True)
        }
        arrays |= {f"cover_{level.name}": a for level, a in zip(LEVELS, gallery.cover, strict=True)}
        handle, temporary = tempfile.mkstemp(dir=self.folder, suffix=".part")
        try:
            with os.fdopen(handle, "wb") as file:
                np.savez(file, allow_pickle=False, **arrays)
                file.flush()
                os.fsync(file.fileno())
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise


@lru_cache(maxsize=1)
def _made_with() -> str:
    """Digest of the encoder's weights and of the numbers that its maps are standardised with."""
    statistics = (files("cadpose") / "data" / "cell-statistics.json").read_bytes()
    encoder = "".join(REGISTRY[name].sha256 for name in ("lite0-trunk", "lite0-middle"))
    return hashlib.sha256(encoder.encode() + statistics).hexdigest()[:16]


def _read(path: Path) -> Described:
    with np.load(path, allow_pickle=False) as data:
        gallery = Described(
            tuple(data[f"cells_{level.name}"] for level in LEVELS),
            tuple(data[f"cover_{level.name}"] for level in LEVELS),
        )
    if len(gallery) != len(grid_rotations()):
        raise ValueError(f"{len(gallery)} templates for {len(grid_rotations())} rotations")
    return gallery
