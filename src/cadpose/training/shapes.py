"""The shapes that training renders, and what is known to be wrong with some of them.

Every model of the sources was rendered and looked at. What was found lies in tables beside this module:
``base-meshes.csv`` and ``ikea-manuals.csv`` (in the format of `cadpose.library.folder`, with one more column,
``unfit``, which tells why a model is left out), and for Sweet Home 3D in that of
`cadpose.library.sweethome3d_exceptions`.
"""

from __future__ import annotations

import csv
from pathlib import Path

from cadpose.errors import InputError
from cadpose.library.class_map import OTHER
from cadpose.library.folder import folder_items
from cadpose.library.importing import ImportItem
from cadpose.library.sweethome3d import sweethome3d_items
from cadpose.library.sweethome3d_exceptions import read_exceptions

DATA = Path(__file__).parent / "data"
FOLDERS = {"base_meshes_cc0": "base-meshes.csv", "ikea_manuals_ccby4": "ikea-manuals.csv"}
"""Folders of models in ``$CADPOSE_BENCH/cad``, each with its table in `DATA`."""

LEFT_OUT = frozenset(
    # Of no category; without a front; in many postures; flat in a wall.
    {OTHER, "tree", "plant", "ball", "person", "dog", "cat", "horse", "door", "window"}
)
"""Categories that rotation training does not use."""


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
        unfit_ids = {e.id for e in read_exceptions() if e.problem == "unfit"}
        items += [i for i in sweethome3d_items(sweethome3d, told) if i.id not in unfit_ids]
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
