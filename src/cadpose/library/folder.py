"""Any folder of OBJ, GLB, glTF, PLY or STL files, with an optional table of what they are.

The table is a CSV file with a header line; only ``file`` is required:

==========  ==========================================================================
file        path of the mesh relative to the folder
name        what a person calls it; by default the file's name
category    library category, or a word for it; by default what the sub-folder's name
            or the file's name says
front       where its front points in the file: +x -x +y -y +z -z; by default -z
up          where its top points; by default +y
licence     by default "unknown"
creator     by default empty
==========  ==========================================================================

A line with an empty ``file`` or ``*`` gives the defaults of all files. Without a table of its own the
folder's ``models.csv`` is used, where there is one. Files that the table does not list are imported too.
"""

from __future__ import annotations

import csv
import io
import os
import re
from pathlib import Path

from cadpose.errors import InputError
from cadpose.library.assets import contained_path, read_capped
from cadpose.library.class_map import OTHER, category_from_name, category_or_word
from cadpose.library.importing import ImportItem
from cadpose.library.limits import MIB
from cadpose.library.loading import MESH_SUFFIXES
from cadpose.library.normalise import rotation_from_axes
from cadpose.library.storage import sha256_of

TABLE_NAME = "models.csv"
_REFERRING = (".obj", ".gltf")
_MOST_SIDE_FILES = 2000
COLUMNS = ("file", "name", "category", "front", "up", "licence", "creator")
_SPELLINGS = {"license": "licence", "path": "file", "class": "category", "author": "creator"}


def folder_items(
    folder: Path,
    *,
    table: Path | None = None,
    category: str | None = None,
    front: str = "-z",
    up: str = "+y",
    licence: str = "unknown",
    problems: list[str] | None = None,
) -> list[ImportItem]:
    """The meshes in a folder and its sub-folders, or one mesh file.

    Ids are ``<folder's name>/<path in the folder>``.

    Args:
        folder: A folder, or a single mesh file.
        table: CSV as described above; by default ``models.csv`` in the folder, if it is there.
        category: Category of models whose table line gives none; by default the sub-folder's name, or the
            start of the file's name.
        front: Front axis of models whose table line gives none.
        up: Up axis, likewise.
        licence: Licence, likewise.
        problems: Lines and files that cannot be used are told here, one sentence each, and left out.

    Raises:
        InputError: no mesh is there, the table is unusable, or an axis given here is none.
    """
    told = problems if problems is not None else []
    rotation_from_axes(front, up)
    if folder.is_file():
        if folder.suffix.lower() not in MESH_SUFFIXES:
            raise InputError(f"{folder} is no mesh file ({', '.join(MESH_SUFFIXES)}).")
        root, files = folder.parent, [folder]
    elif folder.is_dir():
        root = folder
        files = sorted(p for p in folder.rglob("*") if p.suffix.lower() in MESH_SUFFIXES and p.is_file())
    else:
        raise InputError(f"{folder} does not exist.")
    if not files:
        raise InputError(f"{folder} holds no mesh file ({', '.join(MESH_SUFFIXES)}).")
    found = table if table is not None else root / TABLE_NAME
    rows = _read_table(found, root, told) if table is not None or found.is_file() else {}
    general = rows.pop("*", {})
    paths = {f.relative_to(root).as_posix(): f for f in files}
    told += [f"{found}: {name} is listed but is not in {root}." for name in rows if name not in paths]
    side_files: dict[Path, str] = {}
    items = []
    for relative, path in paths.items():
        row = general | {k: v for k, v in rows.get(relative, {}).items() if v}
        try:
            rotation = rotation_from_axes(row.get("front") or front, row.get("up") or up)
        except InputError as error:
            told.append(f"{relative}: {error}")
            continue
        beside = ""
        if path.suffix.lower() in _REFERRING:
            if path.parent not in side_files:
                side_files[path.parent] = _side_files(path.parent)
            beside = side_files[path.parent]
        items.append(
            ImportItem(
                id=f"{root.resolve().name or 'models'}/{relative}",
                name=row.get("name") or path.stem,
                category=_category(row.get("category") or category, relative),
                container=str(root.resolve() / relative),
                root=str(root.resolve()),
                fingerprint=_fingerprint(path, beside),
                R_s_from_file=tuple(float(x) for x in rotation.ravel()),
                source=f"folder:{root.resolve().name}",
                licence=row.get("licence") or licence,
                creator=row.get("creator", ""),
            )
        )
    return items


def _fingerprint(path: Path, beside: str) -> str:
    """The mesh's name, size and time, and what is known of the files that it may refer to."""
    return sha256_of(f"{_stamp(path)}\n{beside}".encode())


def _stamp(path: Path) -> str:
    try:
        stat = path.stat()
    except OSError:  # a link to nothing, or gone meanwhile
        return f"{path.name}:-"
    return f"{path.name}:{stat.st_size}:{stat.st_mtime_ns}"


def _side_files(folder: Path) -> str:
    """Names, sizes and times of what meshes in a folder may refer to, `_MOST_SIDE_FILES` at most.

    That is every file but meshes, the table and hidden ones, in the folder and its sub-folders without
    meshes.
    """
    told: list[str] = []
    for place, folders, names in os.walk(folder):
        folders[:] = sorted(f for f in folders if not f.startswith("."))
        meshes = [n for n in names if n.lower().endswith(MESH_SUFFIXES)]
        if meshes and Path(place) != folder:
            folders.clear()
            continue
        side = sorted(n for n in set(names).difference(meshes) if n != TABLE_NAME and not n.startswith("."))
        within = Path(place).relative_to(folder).as_posix()
        told += [f"{within}/{_stamp(Path(place, n))}" for n in side[: _MOST_SIDE_FILES - len(told)]]
        if len(told) >= _MOST_SIDE_FILES:
            break
    return "\n".join(told)


def _category(given: str | None, relative: str) -> str:
    if given:
        return category_or_word(given)
    parts = relative.split("/")
    for part in (*reversed(parts[:-1]), parts[-1].rsplit(".", 1)[0]):
        known = _category_of_words(part)
        if known:
            return known
    return parts[-2].strip().lower() if len(parts) > 1 else OTHER


def _category_of_words(text: str) -> str | None:
    """What a file or folder name says: its last words ("dining_chair_01"), else its first ("chair_agam")."""
    words = [w for w in re.split(r"[\s_\-.]+", text.lower()) if w and not w.isdigit()]
    ends = [words[i:] for i in range(len(words))]
    starts = [words[:i] for i in range(len(words) - 1, 0, -1)]
    named = (category_from_name(" ".join(phrase)) for phrase in (*ends, *starts))
    return next((n for n in named if n), None)


def _read_table(path: Path, root: Path, problems: list[str]) -> dict[str, dict[str, str]]:
    try:
        text = read_capped(path, 64 * MIB).decode("utf-8-sig")
        reader = csv.DictReader(io.StringIO(text, newline=""))
        header = [(n or "").strip().lower() for n in reader.fieldnames or []]
        header = [_SPELLINGS.get(n, n) for n in header]
        if "file" not in header:
            raise InputError(f"{path} needs a header line with a column named file.")
        reader.fieldnames = header
        rows: dict[str, dict[str, str]] = {}
        for row in reader:
            clean = {k: (row.get(k) or "").strip() for k in COLUMNS}
            if clean["file"] in ("", "*"):
                rows["*"] = {k: v for k, v in clean.items() if v and k not in ("file", "name")}
                continue
            try:
                name = contained_path(clean["file"], "", path.name)
            except InputError as error:
                problems.append(str(error))
                continue
            rows[name or clean["file"]] = clean
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path} is no CSV table in UTF-8 ({error}).") from error
    return rows
