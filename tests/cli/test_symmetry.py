"""``cadpose library symmetry``."""

from __future__ import annotations

import json

from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from tests.cli.invoking import cadpose


def test_table_models_and_json(small_library: Library) -> None:
    common = ["--library", small_library.path]
    table = cadpose("library", "symmetry", *common)
    assert table.exit_code == 0
    assert "trivial" in table.stdout and "chair" in table.stdout
    told = json.loads(cadpose("library", "symmetry", *common, "--json").stdout)
    assert [entry["id"] for entry in told] == [model.id for model in small_library.models()]
    # Cars have tail lights behind, chairs a back.
    assert {entry["upright"] for entry in told} == {"trivial"}
    assert all(SymmetryGroup.from_json(entry).name == entry["name"] for entry in told)
    some = cadpose("library", "symmetry", "chair", *common, "--json")
    assert {entry["category"] for entry in json.loads(some.stdout)} == {"chair"}
    listed = cadpose("library", "symmetry", "chair", *common, env={"COLUMNS": "200"})
    assert "about the vertical" in listed.stdout


def test_an_unknown_category(small_library: Library) -> None:
    result = cadpose("library", "symmetry", "zebra", "--library", small_library.path)
    assert result.exit_code == 1
    assert "zebra" in result.stderr and "Traceback" not in result.output
