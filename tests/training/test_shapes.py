from __future__ import annotations

import csv
from pathlib import Path

import pytest

from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES
from cadpose.library.folder import folder_items
from cadpose.library.normalise import rotation_from_axes
from cadpose.training.shapes import (
    DATA,
    FOLDERS,
    LEFT_OUT,
    training_items,
    unfit_files,
)
from tests.small_library import write_models


def rows_of(table: str) -> list[dict[str, str]]:
    with (DATA / table).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


@pytest.mark.parametrize("table", FOLDERS.values())
def test_every_line_of_a_table_names_a_category_and_two_axes(table: str) -> None:
    general, *rows = rows_of(table)
    assert general["file"] == "*" and general["licence"] and general["creator"]
    assert len({row["file"] for row in rows}) == len(rows) > 30
    for row in rows:
        rotation_from_axes(row["front"], row["up"])
        # What is unfit is in no category: the folder imported by its table offers it to no photo.
        assert row["category"] in CATEGORIES or row["category"] == "other"
        assert not row["unfit"] or row["category"] == "other"


@pytest.mark.parametrize(("folder", "table"), FOLDERS.items())
def test_the_table_lists_every_file_of_the_folder(bench: Path, folder: str, table: str) -> None:
    problems: list[str] = []
    items = folder_items(bench / "cad" / folder, table=DATA / table, problems=problems)
    assert problems == []
    assert {i.id.partition("/")[2] for i in items} == {row["file"] for row in rows_of(table)[1:]}
    assert {i.licence for i in items} <= {"CC0-1.0", "CC-BY-4.0"}


def test_unfit_files_are_told_with_the_reason(tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text("file,unfit\n*,\na.obj,\nb.obj,legs only\n")
    assert unfit_files(table) == {"b.obj": "legs only"}


def test_training_items_leave_out_what_is_unfit_or_without_front(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    models = write_models(tmp_path / "cad" / "mine")
    files = sorted(p.relative_to(models).as_posix() for p in models.rglob("*.obj"))
    assert len(files) >= 3
    table = tmp_path / "mine.csv"
    lines = [f"{files[0]},chair,legs only", f"{files[1]},tree,", *(f"{f},chair," for f in files[2:])]
    table.write_text("\n".join(["file,category,unfit", *lines]))
    monkeypatch.setattr("cadpose.training.shapes.FOLDERS", {"mine": str(table), "absent": str(table)})
    problems: list[str] = []
    found = training_items(None, tmp_path / "cad", problems)
    assert [i.id for i in found if i.id.endswith(".obj")] == [f"mine/{f}" for f in files[2:]]
    assert any("absent" in p for p in problems)
    assert not {i.category for i in found} & LEFT_OUT


def test_no_source_at_all_is_an_error() -> None:
    with pytest.raises(InputError, match="no model for training"):
        training_items(None, None)
