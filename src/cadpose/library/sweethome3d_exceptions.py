"""What is wrong with some Sweet Home 3D models, found by rendering and looking at every one.

========  =====================================================================
front     the model's front at azimuth 0 is wrong; ``detail`` is the axis, in the
          frame that the catalogue tells, where its front really points
category  the catalogue's name misled; ``detail`` is the right library category
unfit     not one recognisable object; ``detail`` says why
========  =====================================================================

An import puts fronts and categories right. What is unfit is imported all the same; training leaves it out.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES, OTHER
from cadpose.library.importing import ImportItem
from cadpose.library.normalise import rotation_from_axes

#: Columns id, problem, detail.
TABLE = "sweethome3d-exceptions.csv"
_PROBLEMS = ("front", "category", "unfit")


@dataclass(frozen=True, slots=True)
class ModelException:
    """One line of the table.

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


def read_exceptions(table: Path | None = None) -> tuple[ModelException, ...]:
    """The exceptions, in the order of the table.

    Raises:
        InputError: a line is wrong.
    """
    table = table or Path(str(files("cadpose") / "data" / TABLE))
    with table.open(encoding="utf-8", newline="") as lines:
        return tuple(ModelException(r["id"], r["problem"], r["detail"]) for r in csv.DictReader(lines))


def corrected(items: Iterable[ImportItem], exceptions: Iterable[ModelException]) -> list[ImportItem]:
    """Items with their fronts and categories put right; what is unfit stays as it is."""
    by_id: dict[str, list[ModelException]] = {}
    for exception in exceptions:
        by_id.setdefault(exception.id, []).append(exception)
    kept: list[ImportItem] = []
    for item in items:
        problems = {e.problem: e.detail for e in by_id.get(item.id, ())}
        if "category" in problems:
            item = replace(item, category=problems["category"])
        if "front" in problems:
            R_s_from_library = rotation_from_axes(problems["front"], "+y")
            R = R_s_from_library @ np.array(item.R_s_from_file).reshape(3, 3)
            item = replace(item, R_s_from_file=tuple(float(x) for x in R.ravel()))
        kept.append(item)
    return kept
