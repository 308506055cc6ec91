"""ShapeNetCore v1 and v2 as they are unpacked: synset folders, ``taxonomy.json``.

v1: ``<synset>/<model>/model.obj`` with ``images/`` beside it; v2: ``<synset>/<model>/models/
model_normalized.obj`` whose materials name ``../images/...``, so a model's own folder is the boundary.
Both have y up and the front towards -z, which are the library's axes.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.library.assets import read_capped
from cadpose.library.class_map import OTHER, category_from_synset
from cadpose.library.importing import ImportItem
from cadpose.library.limits import MIB
from cadpose.library.storage import sha256_of

_SYNSET = re.compile(r"^\d{8}$")
_LAYOUTS = ("models/model_normalized.obj", "model.obj")
_LICENCE = "ShapeNet-terms"


def is_shapenet(folder: Path) -> bool:
    """Whether a folder looks like ShapeNetCore: a taxonomy, or folders of eight digits with models."""
    if not folder.is_dir():
        return False
    if (folder / "taxonomy.json").is_file():
        return True
    synsets = [p for p in folder.iterdir() if _SYNSET.match(p.name) and p.is_dir()]
    return any(_mesh_of(m) for s in synsets for m in islice(s.iterdir(), 20) if m.is_dir())


def shapenet_items(
    root: Path,
    *,
    categories: tuple[str, ...] | None = None,
    limit: int | Mapping[str, int] | None = None,
    problems: list[str] | None = None,
) -> list[ImportItem]:
    """The models of an unpacked ShapeNetCore.

    Ids are ``ShapeNetCore/<synset>/<model>``. A model of a child synset counts as its nearest ancestor
    that has a category, by the taxonomy.

    Args:
        root: The folder that holds the synset folders.
        categories: Library categories to keep; all by default.
        limit: Most models a category, the first in order of id; one number for all, or one a category
            (categories not named are not limited).
        problems: Model folders without a mesh are told here, one sentence each.

    Raises:
        InputError: the folder is no ShapeNetCore, its taxonomy is damaged, or nothing is left to import.
    """
    told = problems if problems is not None else []
    if not is_shapenet(root):
        raise InputError(
            f"{root} is no ShapeNetCore: it has neither a taxonomy.json nor synset folders such as 03001627."
        )
    names, parents = _taxonomy(root / "taxonomy.json")
    items: list[ImportItem] = []
    taken: dict[str, int] = {}
    for synset_folder in sorted(p for p in root.iterdir() if _SYNSET.match(p.name) and p.is_dir()):
        synset = synset_folder.name
        category = _category(synset, parents)
        if categories is not None and category not in categories:
            continue
        most = limit if isinstance(limit, int) or limit is None else limit.get(category)
        for folder in sorted(p for p in synset_folder.iterdir() if p.is_dir()):
            if most is not None and taken.get(category, 0) >= most:
                break
            mesh = _mesh_of(folder)
            if mesh is None:
                told.append(f"{folder} holds no {_LAYOUTS[0]} or {_LAYOUTS[1]}; it was left out.")
                continue
            taken[category] = taken.get(category, 0) + 1
            label = names.get(synset, category).split(",")[0]
            items.append(
                ImportItem(
                    id=f"ShapeNetCore/{synset}/{folder.name}",
                    name=f"{label} {folder.name[:8]}",
                    category=category,
                    container=str(folder.resolve() / mesh.relative_to(folder)),
                    root=str(folder.resolve()),
                    fingerprint=_fingerprint(folder),
                    source=f"shapenet:{'v2' if mesh.parent != folder else 'v1'}",
                    licence=_LICENCE,
                )
            )
    if not items:
        raise InputError(f"{root} holds no ShapeNetCore model of the categories asked for.")
    return items


def _mesh_of(folder: Path) -> Path | None:
    return next((folder / layout for layout in _LAYOUTS if (folder / layout).is_file()), None)


def _fingerprint(folder: Path) -> str:
    """Names, sizes and times of a model's files: reading 50,000 models twice would take an hour."""
    told = []
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        stat = path.stat()
        told.append(f"{path.relative_to(folder).as_posix()}:{stat.st_size}:{stat.st_mtime_ns}")
    return sha256_of("\n".join(told).encode())


def _taxonomy(path: Path) -> tuple[dict[str, str], dict[str, str]]:
    """({synset: name}, {child: parent}); both empty where there is no taxonomy."""
    if not path.is_file():
        return {}, {}
    try:
        entries: Any = json.loads(read_capped(path, 64 * MIB))
        names = {str(e["synsetId"]): str(e.get("name", "")) for e in entries}
        parents = {str(child): str(e["synsetId"]) for e in entries for child in e.get("children", [])}
    except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
        raise InputError(f"{path} is not ShapeNet's taxonomy ({error}).") from error
    return names, parents


def _category(synset: str, parents: dict[str, str]) -> str:
    seen: set[str] = set()
    at: str | None = synset
    while at is not None and at not in seen:
        found = category_from_synset(at)
        if found is not None:
            return found
        seen.add(at)
        at = parents.get(at)
    return OTHER
