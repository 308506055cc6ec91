"""One way in for everything that can be added to a library: the kind of source is told by looking."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.folder import folder_items
from cadpose.library.importing import AddReport, ImportItem, Progress
from cadpose.library.parametric.items import parametric_items
from cadpose.library.shapenet import is_shapenet, shapenet_items
from cadpose.library.sweethome3d import sweethome3d_items


def find_items(
    path: Path,
    *,
    categories: tuple[str, ...] | None = None,
    limit: int | Mapping[str, int] | None = None,
    table: Path | None = None,
    category: str | None = None,
    front: str = "-z",
    up: str = "+y",
    problems: list[str] | None = None,
) -> list[ImportItem]:
    """The models of a .sh3f file, a folder of them, a ShapeNetCore, a folder of meshes or one mesh file.

    Args:
        path: What to import.
        categories: Library categories to keep; all by default.
        limit: Most models a category, first in order of id; a number for all, or one a category.
        table: CSV table of a folder of meshes (see `cadpose.library.folder`).
        category: Category of a folder's models that have none of their own.
        front: Front axis of a folder's models.
        up: Up axis of a folder's models.
        problems: What cannot be imported is told here, one sentence each.

    Raises:
        InputError: nothing usable is there.
    """
    if path.suffix.lower() == ".sh3f" or (path.is_dir() and any(path.glob("*.sh3f"))):
        items = sweethome3d_items(path, problems)
    elif is_shapenet(path):
        return shapenet_items(path, categories=categories, limit=limit, problems=problems)
    else:
        items = folder_items(path, table=table, category=category, front=front, up=up, problems=problems)
    kept: list[ImportItem] = []
    taken: dict[str, int] = {}
    for item in sorted(items, key=lambda i: i.id):
        most = limit if isinstance(limit, int) or limit is None else limit.get(item.category)
        if categories is not None and item.category not in categories:
            continue
        if most is not None and taken.get(item.category, 0) >= most:
            continue
        taken[item.category] = taken.get(item.category, 0) + 1
        kept.append(item)
    if not kept:
        raise InputError(
            f"{path} holds no model of the categories asked for ({', '.join(categories or ())})."
        )
    return kept


def add_path(
    library: Library,
    path: Path,
    *,
    categories: tuple[str, ...] | None = None,
    limit: int | Mapping[str, int] | None = None,
    table: Path | None = None,
    category: str | None = None,
    front: str = "-z",
    up: str = "+y",
    workers: int = 1,
    progress: Progress | None = None,
) -> AddReport:
    """`find_items` and `Library.add` in one; what could not be listed is among the report's failures.

    Raises:
        InputError: nothing usable is there.
        LibraryError: the library cannot be written.
    """
    problems: list[str] = []
    items = find_items(
        path,
        categories=categories,
        limit=limit,
        table=table,
        category=category,
        front=front,
        up=up,
        problems=problems,
    )
    report = library.add(items, workers=workers, progress=progress)
    return replace(report, failed=report.failed + tuple((str(path), p) for p in problems))


def add_parametric(
    library: Library,
    *,
    categories: tuple[str, ...] | None = None,
    limit: int | Mapping[str, int] | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> AddReport:
    """Make models by formula and add them; the same models each time, however many are asked for.

    Args:
        library: Takes them.
        categories: Library categories; all that can be made by default.
        limit: Models a category, ten by default; a number for all, or one a category.
        workers: Processes.
        progress: Told of every model.

    Raises:
        InputError: a category cannot be made.
        LibraryError: the library cannot be written.
    """
    return library.add(parametric_items(categories, limit), workers=workers, progress=progress)
