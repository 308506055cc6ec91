"""The CAD library: a folder with an index and one mesh file a model."""

from __future__ import annotations

import difflib
import io
import logging
import os
import sqlite3
from collections import OrderedDict
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray
from platformdirs import user_data_dir

from cadpose.errors import LibraryError
from cadpose.geometry.symmetry import SymmetryGroup
from cadpose.library.importing import AddReport, Imported, ImportItem, Progress, import_all, mesh_path
from cadpose.library.mesh import Mesh
from cadpose.library.sampling import farthest_points, sample_surface
from cadpose.library.storage import mesh_from_file, sha256_of, write_atomic
from cadpose.library.symmetry import kept_symmetry
from cadpose.records import CadModel

log = logging.getLogger(__name__)

INDEX = "index.sqlite"
_SCHEMA = 1
_NEAR_DUPLICATE = 0.12
"""Descriptor distance up to which two models count as the same shape: recoloured or hardly changed."""

_TABLES = """
CREATE TABLE IF NOT EXISTS models (
    id TEXT PRIMARY KEY, name TEXT NOT NULL, category TEXT NOT NULL, source TEXT NOT NULL,
    licence TEXT NOT NULL, creator TEXT NOT NULL, width REAL, depth REAL, height REAL,
    faces INTEGER NOT NULL, sha256 TEXT NOT NULL, scale REAL NOT NULL, key TEXT NOT NULL,
    descriptor BLOB NOT NULL
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS by_category ON models (category, id);
"""
_COLUMNS = "id, name, category, source, licence, creator, width, depth, height, faces, sha256"
_HOW_TO_ADD = (
    "add models with `cadpose library add PATH` (Sweet Home 3D files, ShapeNetCore, or a folder of meshes)"
)


def default_path() -> Path:
    """``$CADPOSE_LIBRARY``, else the user's data folder."""
    told = os.environ.get("CADPOSE_LIBRARY")
    return Path(told).expanduser() if told else Path(user_data_dir("cadpose")) / "library"


@dataclass(eq=False)
class Library:
    """A catalogue on disk. Make one with `open` or `create`.

    Attributes:
        path: The folder.
        cache_size: How many meshes stay in memory.

    Examples:
        >>> import tempfile
        >>> from pathlib import Path
        >>> import trimesh
        >>> from cadpose import Library
        >>> from cadpose.library.importers import add_path
        >>> folder = Path(tempfile.mkdtemp())
        >>> _ = trimesh.creation.box((0.4, 0.5, 1.0)).export(folder / "crate.obj")
        >>> add_path(Library.create(folder / "library"), folder / "crate.obj", category="box").failed
        ()
        >>> library = Library.open(folder / "library")
        >>> crate = library.models("box")[0]
        >>> crate.name, crate.face_count, library.categories()
        ('crate', 12, {'box': 1})
        >>> library.mesh(crate).vertices.shape, library.symmetry(crate).name
        ((8, 3), 'D2')
    """

    path: Path
    cache_size: int = 16
    _meshes: OrderedDict[str, Mesh] = field(default_factory=OrderedDict, init=False, repr=False)
    _representatives: dict[tuple[str, int], tuple[CadModel, ...]] = field(
        default_factory=dict, init=False, repr=False
    )
    _lock: Lock = field(default_factory=Lock, init=False, repr=False)

    @classmethod
    def open(cls, path: Path | None = None) -> Library:
        """Open a library that holds at least one model.

        Args:
            path: Its folder; by default ``$CADPOSE_LIBRARY`` or the user's data folder.

        Raises:
            LibraryError: there is none, it is damaged, or it is empty.
        """
        folder = path or default_path()
        if not (folder / INDEX).is_file():
            raise LibraryError(f"There is no CAD library at {folder}; {_HOW_TO_ADD}.")
        library = cls(folder)
        if not library._models:
            raise LibraryError(f"The CAD library at {folder} is empty; {_HOW_TO_ADD}.")
        return library

    @classmethod
    def create(cls, path: Path | None = None) -> Library:
        """Open a library to add to, making it if it is not there.

        Raises:
            LibraryError: the folder cannot be made, or what is there is no library.
        """
        folder = path or default_path()
        try:
            (folder / "meshes").mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise LibraryError(f"The library folder {folder} cannot be made ({error.strerror}).") from error
        library = cls(folder)
        with library._database(write=True) as db:
            if db.execute("PRAGMA user_version").fetchone()[0] not in (0, _SCHEMA):
                raise LibraryError(f"{folder} was made by another version of cadpose; choose a new folder.")
            db.executescript(_TABLES)
            db.execute(f"PRAGMA user_version = {_SCHEMA}")
        return library

    # -- reading ---------------------------------------------------------------------------------

    def models(self, category: str | None = None) -> tuple[CadModel, ...]:
        """Every model, or those of one category, in order of id."""
        return tuple(m for m in self._models.values() if category is None or m.category == category)

    def categories(self) -> dict[str, int]:
        """Number of models a category, in alphabetical order."""
        counts: dict[str, int] = {}
        for model in self._models.values():
            counts[model.category] = counts.get(model.category, 0) + 1
        return dict(sorted(counts.items()))

    def get(self, cad_id: str) -> CadModel:
        """The model of that id.

        Raises:
            LibraryError: there is none; the message names close matches.
        """
        found = self._models.get(cad_id)
        if found is None:
            log.debug("no model %r in %s", cad_id, self.path)
            raise LibraryError(f"There is no CAD model {cad_id!r} in the library{self._close(cad_id)}.")
        return found

    def mesh(self, cad: CadModel | str) -> Mesh:
        """A model's mesh: ShapeNet axes, centred, unit bounding-box diagonal.

        Raises:
            LibraryError: no such model, or its file is damaged.
        """
        model = self.get(cad if isinstance(cad, str) else cad.id)
        # Template galleries are drawn by several threads.
        with self._lock:
            if model.sha256 in self._meshes:
                self._meshes.move_to_end(model.sha256)
            else:
                try:
                    mesh = mesh_from_file(mesh_path(self._mesh_folder, model.sha256))
                except LibraryError as error:
                    raise LibraryError(f"{model.id}: {error}") from error
                self._meshes[model.sha256] = mesh
                while len(self._meshes) > self.cache_size:
                    self._meshes.popitem(last=False)
            return self._meshes[model.sha256]

    def surface_samples(self, cad: CadModel | str, count: int = 60_000, seed: int = 0) -> NDArray[np.float32]:
        """Points on a model's surface, uniform by area (the paper's CloudCompare step).

        They are kept on disk beside the mesh; a library that cannot be written is sampled anew.

        Returns:
            (count, 3) float32, the same for the same model, count and seed.

        Raises:
            LibraryError: no such model, or its file is damaged.
        """
        if count < 1:
            raise ValueError(f"count must be at least 1, got {count}")
        model = self.get(cad if isinstance(cad, str) else cad.id)
        kept = mesh_path(self._mesh_folder, model.sha256).with_suffix(f".{count}-{seed}.npy")
        with suppress(OSError, ValueError, EOFError):
            points = np.load(kept, allow_pickle=False)
            if points.shape == (count, 3) and points.dtype == np.float32:
                return np.asarray(points, dtype=np.float32)
        points = sample_surface(self.mesh(model), count, seed)
        out = io.BytesIO()
        np.save(out, points, allow_pickle=False)
        with suppress(OSError):
            write_atomic(kept, out.getvalue())
        return points

    def symmetry(self, cad: CadModel | str) -> SymmetryGroup:
        """The rotations that leave a model as it looks, worked out once and kept on disk beside the mesh.

        Raises:
            LibraryError: no such model, or its file is damaged.
        """
        model = self.get(cad if isinstance(cad, str) else cad.id)
        return kept_symmetry(mesh_path(self._mesh_folder, model.sha256), lambda: self.mesh(model))

    def representatives(self, category: str, count: int = 10) -> tuple[CadModel, ...]:
        """Up to ``count`` models that show how a category varies: the most typical one first.

        Then always the one least like those chosen. Near duplicates are passed over, so there may be
        fewer than asked for. The choice depends on the library's content alone.

        Raises:
            LibraryError: the category has no model.
        """
        known = self._representatives.get((category, count))
        if known is not None:
            return known
        models = self.models(category)
        if not models:
            raise LibraryError(
                f"The library has no model of category {category!r}; it has {', '.join(self.categories())}."
            )
        rows = np.stack([self._descriptors[m.id] for m in models])
        chosen = tuple(models[i] for i in farthest_points(rows, count, _NEAR_DUPLICATE))
        self._representatives[category, count] = chosen
        return chosen

    @property
    def digest(self) -> str:
        """Changes whenever a model is added, changed or moved to another category."""
        told = "\n".join(f"{m.id}\t{m.category}\t{m.sha256}" for m in self._models.values())
        return sha256_of(told.encode())

    def scale(self, cad_id: str) -> float:
        """What the source file's lengths were multiplied by to reach a unit diagonal."""
        self.get(cad_id)
        with self._database() as db:
            return float(db.execute("SELECT scale FROM models WHERE id = ?", (cad_id,)).fetchone()[0])

    def check(self) -> list[str]:
        """One sentence for everything that is wrong; empty when all is well."""
        problems: list[str] = []
        wanted = set()
        for model in self._models.values():
            path = mesh_path(self._mesh_folder, model.sha256)
            wanted.add(path.name.split(".")[0])
            try:
                if sha256_of(path.read_bytes()) != model.sha256:
                    problems.append(f"{model.id}: {path} has been changed; add the model again.")
                elif len(mesh_from_file(path).faces) != model.face_count:
                    problems.append(f"{model.id}: the index counts other faces than {path} has.")
            except OSError:
                problems.append(f"{model.id}: {path} is missing; add the model again.")
            except LibraryError as error:
                problems.append(f"{model.id}: {error}")
        problems += [
            f"{path} belongs to no model; it can be deleted."
            for path in sorted(self._mesh_folder.glob("*/*"))
            if path.name.split(".")[0] not in wanted
        ]
        return problems

    # -- writing ---------------------------------------------------------------------------------

    def add(
        self, items: Iterable[ImportItem], *, workers: int = 1, progress: Progress | None = None
    ) -> AddReport:
        """Import models; those whose source has not changed are left as they are.

        Every model is committed as a whole: a bad one is reported and the others go on, and a library
        whose import was killed midway is valid and holds what was done.

        Args:
            items: What an importer found.
            workers: Processes; with more than one, a script needs the ``if __name__ == "__main__"`` guard.
            progress: Called after every model.

        Raises:
            LibraryError: the library cannot be written.
        """
        wanted = list({item.id: item for item in items}.values())
        with self._database() as db:
            known = {row[0]: row[1:] for row in db.execute("SELECT id, key, sha256 FROM models")}
        unchanged = [
            i.id
            for i in wanted
            if i.id in known
            and known[i.id][0] == i.key
            and mesh_path(self._mesh_folder, known[i.id][1]).is_file()
        ]
        same = set(unchanged)
        todo = [i for i in wanted if i.id not in same]
        added: list[str] = []
        updated: list[str] = []
        failed: list[tuple[str, str]] = []
        warned: list[str] = []
        count = len(unchanged)

        with self._database(write=True) as db:

            def done(result: Imported) -> None:
                nonlocal count
                count += 1
                warned.extend(f"{result.item.id}: {w}" for w in result.warnings)
                if result.problem:
                    failed.append((result.item.id, result.problem))
                else:
                    (updated if result.item.id in known else added).append(result.item.id)
                    _insert(db, result)
                    db.commit()
                if progress is not None:
                    progress(count, len(wanted), result.item.name)

            if progress is not None and unchanged:
                progress(count, len(wanted), "unchanged")
            try:
                import_all(todo, self._mesh_folder, workers, done)
            finally:
                self._forget()
            self._drop_unused(db, {known[i][1] for i in updated})
        return AddReport(
            tuple(sorted(added)),
            tuple(sorted(updated)),
            tuple(unchanged),
            tuple(sorted(failed)),
            tuple(sorted(warned)),
        )

    def remove(self, cad_ids: Iterable[str]) -> int:
        """Take models out of the library; returns how many were there."""
        gone = {i: self._models[i].sha256 for i in cad_ids if i in self._models}
        with self._database(write=True) as db:
            db.executemany("DELETE FROM models WHERE id = ?", [(i,) for i in gone])
            db.commit()
            self._drop_unused(db, set(gone.values()))
        self._forget()
        return len(gone)

    # -- inside ----------------------------------------------------------------------------------

    @property
    def _mesh_folder(self) -> Path:
        return self.path / "meshes"

    @cached_property
    def _models(self) -> dict[str, CadModel]:
        with self._database() as db:
            rows = db.execute(f"SELECT {_COLUMNS} FROM models ORDER BY id").fetchall()
        return {row[0]: _record(row) for row in rows}

    @cached_property
    def _descriptors(self) -> dict[str, NDArray[np.float32]]:
        with self._database() as db:
            rows = db.execute("SELECT id, descriptor FROM models").fetchall()
        return {i: np.frombuffer(blob, dtype=np.float16).astype(np.float32) for i, blob in rows}

    def _drop_unused(self, db: sqlite3.Connection, sha256s: set[str]) -> None:
        """Delete the files of meshes that no model has any more, with their samples."""
        for sha256 in sha256s:
            if db.execute("SELECT 1 FROM models WHERE sha256 = ? LIMIT 1", (sha256,)).fetchone() is None:
                folder = mesh_path(self._mesh_folder, sha256).parent
                for path in folder.glob(f"{sha256}.*"):
                    path.unlink(missing_ok=True)

    def _forget(self) -> None:
        self.__dict__.pop("_models", None)
        self.__dict__.pop("_descriptors", None)
        self._representatives.clear()

    def _close(self, cad_id: str) -> str:
        tail = cad_id.rsplit("/", 1)[-1].lower()
        close = [i for i in self._models if tail and tail in i.lower()][:3]
        close = close or difflib.get_close_matches(cad_id, list(self._models), 3, 0.5)
        return f"; did you mean {' or '.join(close)}" if close else "; `cadpose library list` names them"

    @contextmanager
    def _database(self, write: bool = False) -> Iterator[sqlite3.Connection]:
        index = self.path / INDEX
        try:
            # Without "ro" a library that lies on read-only media could not be read.
            where = f"{index.resolve().as_uri()}?mode={'rwc' if write else 'ro'}"
            db = sqlite3.connect(where, uri=True, timeout=60.0)
            try:
                yield db
                db.commit()
            finally:
                db.close()
        except sqlite3.Error as error:
            raise LibraryError(f"The library's index {index} cannot be used ({error}).") from error


def _insert(db: sqlite3.Connection, result: Imported) -> None:
    item = result.item
    size = item.size_cm or (None, None, None)
    assert result.descriptor is not None
    db.execute(
        f"INSERT OR REPLACE INTO models ({_COLUMNS}, scale, key, descriptor) VALUES ({'?, ' * 13}?)",
        (
            *(item.id, item.name, item.category, item.source, item.licence, item.creator),
            *size,
            *(result.face_count, result.sha256, result.scale, item.key),
            result.descriptor.astype(np.float16).tobytes(),
        ),
    )


def _record(row: tuple[str, ...]) -> CadModel:
    cad_id, name, category, source, licence, creator, width, depth, height, faces, sha256 = row
    size = None if width is None else (float(width), float(depth), float(height))
    return CadModel(cad_id, name, category, source, licence, creator, size, int(faces), sha256)
