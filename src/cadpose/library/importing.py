"""What an importer hands to the library, and the work done for one model in a worker process."""

from __future__ import annotations

import logging
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from functools import lru_cache
from multiprocessing import get_context, parent_process
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.errors import CadposeError
from cadpose.library.assets import Archive, ZipAssets
from cadpose.library.limits import DEFAULT_LIMITS
from cadpose.library.loading import load_mesh, load_mesh_file
from cadpose.library.normalise import normalise
from cadpose.library.sampling import shape_descriptor
from cadpose.library.storage import mesh_to_bytes, sha256_of, write_atomic

log = logging.getLogger(__name__)

IMPORT_VERSION = 3
"""Part of every fingerprint: raise it when the import of an unchanged file would give another mesh."""

GENERATED = "parametric:"
"""Container of a model that is made by formula: this and its category; the member is the seed."""

Progress = Callable[[int, int, str], None]
"""Called as ``progress(done, total, name)``."""

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class ImportItem:
    """One model to be added.

    Attributes:
        id: The catalogue id it will have.
        name: What a person calls it.
        category: Library category.
        container: A mesh file, the archive that holds it, or `GENERATED` and a category.
        member: The mesh's path in the archive, or the seed; empty for a file.
        root: Folder that a file's materials and textures have to lie in; empty for the file's own.
        fingerprint: Changes when the source changes; an unchanged model is not imported again.
        R_s_from_file: Rotation to ShapeNet axes, nine values by rows.
        source: Importer and file, for the record.
        licence: SPDX-like.
        creator: Author, or empty.
        size_cm: Width, depth, height in centimetres, or None.
    """

    id: str
    name: str
    category: str
    container: str
    member: str = ""
    root: str = ""
    fingerprint: str = ""
    R_s_from_file: tuple[float, ...] = IDENTITY
    source: str = ""
    licence: str = "unknown"
    creator: str = ""
    size_cm: tuple[float, float, float] | None = None

    @property
    def key(self) -> str:
        """Digest of everything that the stored model depends on."""
        told = (IMPORT_VERSION, self.id, self.name, self.category, self.fingerprint, self.R_s_from_file)
        more = (self.source, self.licence, self.creator, self.size_cm)
        return sha256_of(repr((told, more)).encode())


@dataclass(frozen=True, eq=False, slots=True)
class Imported:
    """What became of one item.

    Attributes:
        item: The item.
        sha256: Digest of the stored mesh file; empty if it failed.
        face_count: Triangles.
        scale: What the file's lengths were multiplied by.
        descriptor: See `shape_descriptor`; empty if it failed.
        problem: Why it failed; empty if it did not.
        warnings: What was mended.
    """

    item: ImportItem
    sha256: str = ""
    face_count: int = 0
    scale: float = 0.0
    descriptor: NDArray[np.float32] | None = None
    problem: str = ""
    warnings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class AddReport:
    """What `Library.add` did, by model id.

    Attributes:
        added: New models.
        updated: Models whose source or description had changed.
        unchanged: Models that were there already.
        failed: (id, reason) of models that cannot be used.
        warnings: What was mended in the others.
    """

    added: tuple[str, ...] = ()
    updated: tuple[str, ...] = ()
    unchanged: tuple[str, ...] = ()
    failed: tuple[tuple[str, str], ...] = ()
    warnings: tuple[str, ...] = ()


@lru_cache(maxsize=4)
def _archive(path: str, stamp: tuple[int, int]) -> Archive:
    return Archive(Path(path))


def open_archive(path: Path) -> Archive:
    """The archive, opened once a process for as long as the file stays the same."""
    try:
        stat = path.stat()
    except OSError:
        return Archive(path)
    return _archive(str(path), (stat.st_size, stat.st_mtime_ns))


def mesh_path(meshes: Path, sha256: str) -> Path:
    """Where a mesh with that digest is kept."""
    return meshes / sha256[:2] / f"{sha256}.npz"


def import_item(item: ImportItem, meshes: str) -> Imported:
    """Load, normalise and store one model. Never raises for a bad model."""
    warnings: list[str] = []
    try:
        if item.container.startswith(GENERATED):
            # Inside the function: only those who make models need the generators.
            from cadpose.library.parametric.registry import make

            mesh = make(item.container.removeprefix(GENERATED), int(item.member))
        elif item.member:
            archive = open_archive(Path(item.container))
            data = archive.read(item.member, DEFAULT_LIMITS.file_bytes)
            mesh = load_mesh(data, item.member, ZipAssets(archive, item.member), warn=warnings.append)
        else:
            root = Path(item.root) if item.root else None
            mesh = load_mesh_file(Path(item.container), root=root, warn=warnings.append)
        mesh, scale = normalise(mesh, np.array(item.R_s_from_file).reshape(3, 3))
        stored = mesh_to_bytes(mesh)
        sha256 = sha256_of(stored)
        path = mesh_path(Path(meshes), sha256)
        if not path.exists():
            write_atomic(path, stored)
        return Imported(
            item, sha256, len(mesh.faces), scale, shape_descriptor(mesh), warnings=tuple(warnings)
        )
    except CadposeError as error:
        return Imported(item, problem=str(error), warnings=tuple(warnings))
    except MemoryError:
        return Imported(item, problem=f"{item.id} needs more memory than there is.")
    except OSError as error:
        return Imported(item, problem=f"{item.id} cannot be stored ({error}).")
    except Exception as error:  # one bad model never stops the others
        log.debug("%s", item.id, exc_info=True)
        return Imported(item, problem=f"{item.id} cannot be imported ({type(error).__name__}: {error}).")


def _pool(workers: int) -> ProcessPoolExecutor:
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"), initializer=_start_worker)


def _start_worker() -> None:
    # Ctrl-C is the parent's to handle; a worker whose parent was killed would wait for ever.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is None:
        return

    def follow() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=follow, daemon=True).start()


def import_all(items: list[ImportItem], meshes: Path, workers: int, done: Callable[[Imported], None]) -> None:
    """Import every item, in worker processes if ``workers`` > 1; ``done`` is called in this process.

    A worker that dies takes down its pool only: what was unfinished is tried again one by one, so that
    the model at fault is named and the others go on.
    """
    if workers <= 1 or len(items) < 4:
        for item in items:
            done(import_item(item, str(meshes)))
        return
    left = dict(enumerate(items))
    try:
        with _pool(workers) as pool:
            futures: dict[Future[Imported], int] = {
                pool.submit(import_item, item, str(meshes)): number for number, item in left.items()
            }
            try:
                for future in as_completed(futures):
                    result = future.result()
                    left.pop(futures[future])
                    done(result)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    except BrokenProcessPool:
        for item in left.values():
            try:
                with _pool(1) as single:
                    result = single.submit(import_item, item, str(meshes)).result()
            except BrokenProcessPool:
                result = Imported(item, problem=f"{item.id} made the import process end; it was left out.")
            done(result)
