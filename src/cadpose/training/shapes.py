"""The shapes that training renders, and what is known to be wrong with some of them.

Every model of the sources was rendered and looked at. What was found lies in tables beside this module:
``base-meshes.csv`` and ``ikea-manuals.csv`` (in the format of `cadpose.library.folder`, with one more column,
``unfit``, which tells why a model is left out) and ``sweethome3d-exceptions.csv`` (id, problem, detail):

========  =====================================================================
front     the model's front at azimuth 0 is wrong; ``detail`` is the axis, in the
          frame of the library as imported, where its front really points
category  the catalogue's name misled; ``detail`` is the right library category
unfit     not one recognisable object; ``detail`` says why
========  =====================================================================
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES, OTHER
from cadpose.library.folder import folder_items
from cadpose.library.importing import ImportItem
from cadpose.library.normalise import rotation_from_axes
from cadpose.library.sweethome3d import sweethome3d_items

DATA = Path(__file__).parent / "data"
FOLDERS = {"base_meshes_cc0": "base-meshes.csv", "ikea_manuals_ccby4": "ikea-manuals.csv"}
"""Folders of models in ``$CADPOSE_BENCH/cad``, each with its table in `DATA`."""

LEFT_OUT = frozenset(
    # Of no category; without a front; in many postures; flat in a wall.
    {OTHER, "tree", "plant", "ball", "person", "dog", "cat", "horse", "door", "window"}
)
"""Categories that rotation training does not use."""

_PROBLEMS = ("front", "category", "unfit")


@dataclass(frozen=True, slots=True)
class ModelException:
    """One line of ``sweethome3d-exceptions.csv``.

    Attributes:
        id: The model.
        problem: ``front``, ``category`` or ``unfit``.
        detail: The right axis, the right category, or the reason.
    """

    id: str
    problem: str
    detail: str

    def __post_init__(self) -> None:
        if self.problem not in _PROBLEMS:
            raise InputError(f"{self.id}: problem {self.problem!r} is none of {', '.join(_PROBLEMS)}.")
        if self.problem == "front":
            rotation_from_axes(self.detail, "+y")
        if self.problem == "category" and self.detail not in {*CATEGORIES, OTHER}:
            raise InputError(f"{self.id}: there is no category {self.detail!r}.")
        if not (self.id and self.detail):
            raise InputError(f"{self.id or 'a line without id'}: problem {self.problem} needs a detail.")


def read_exceptions(table: Path = DATA / "sweethome3d-exceptions.csv") -> tuple[ModelException, ...]:
    """The exceptions, in the order of the table.

    Raises:
        InputError: a line is wrong.
    """
    with table.open(encoding="utf-8", newline="") as lines:
        return tuple(ModelException(r["id"], r["problem"], r["detail"]) for r in csv.DictReader(lines))


def corrected(items: Iterable[ImportItem], exceptions: Iterable[ModelException]) -> list[ImportItem]:
    """Items with their fronts and categories put right, without those that are unfit."""
    by_id: dict[str, list[ModelException]] = {}
    for exception in exceptions:
        by_id.setdefault(exception.id, []).append(exception)
    kept: list[ImportItem] = []
    for item in items:
        problems = {e.problem: e.detail for e in by_id.get(item.id, ())}
        if "unfit" in problems:
            continue
        if "category" in problems:
            item = replace(item, category=problems["category"])
        if "front" in problems:
            R_s_from_library = rotation_from_axes(problems["front"], "+y")
            R = R_s_from_library @ np.array(item.R_s_from_file).reshape(3, 3)
            item = replace(item, R_s_from_file=tuple(float(x) for x in R.ravel()))
        kept.append(item)
    return kept


def unfit_files(table: Path) -> dict[str, str]:
    """Files that a folder's table calls unfit, with the reason."""
    with table.open(encoding="utf-8", newline="") as lines:
        return {row["file"]: row["unfit"] for row in csv.DictReader(lines) if row.get("unfit")}


def training_items(
    sweethome3d: Path | None, cad: Path | None, problems: list[str] | None = None
) -> list[ImportItem]:
    """What the training library is made of, corrected; parametric models are not among it.

    Args:
        sweethome3d: Folder of the Sweet Home 3D libraries, or None.
        cad: Folder that holds those of `FOLDERS`, or None; one that is not there is told in ``problems``.
        problems: What cannot be used is told here, one sentence each.

    Raises:
        InputError: nothing usable is there.
    """
    told = problems if problems is not None else []
    items: list[ImportItem] = []
    if sweethome3d is not None:
        items += corrected(sweethome3d_items(sweethome3d, told), read_exceptions())
    for folder, table in FOLDERS.items() if cad is not None else ():
        assert cad is not None
        if not (cad / folder).is_dir():
            told.append(f"{cad / folder} is not there.")
            continue
        unfit = unfit_files(DATA / table)
        items += [
            item
            for item in folder_items(cad / folder, table=DATA / table, problems=told)
            if item.id.partition("/")[2] not in unfit
        ]
    items = [item for item in items if item.category not in LEFT_OUT]
    if not items:
        raise InputError(
            "there is no model for training: install sweethome3d-furniture or set CADPOSE_BENCH."
        )
    return items
