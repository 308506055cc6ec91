"""`cadpose synth`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.datasets.labels import read_labels
from cadpose.library.catalogue import Library
from cadpose.training import held_out
from tests.cli.invoking import cadpose, one_sentence, said


def synth(library: Library, out: Path, *options: object) -> list[object]:
    return ["synth", out, "--library", library.path, "--size", 64, "--workers", 1, *options]


def test_a_table_and_a_sheet(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    result = cadpose(*synth(small_library, out, "--count", 10, "--category", "chair", "--seed", 2))
    assert result.exit_code == 0, result.output
    labels = read_labels(out / "labels.jsonl")
    cells = [[cell.strip() for cell in line.split("│")[1:-1]] for line in result.stdout.splitlines()]
    assert ["chair", str(len(labels)), "100%"] in cells and ["all", str(len(labels)), ""] in cells
    assert {label.category for label in labels} == {"chair"}
    with Image.open(out / "sheet.jpg") as sheet:
        assert sheet.size[0] > 8 * 200 and np.asarray(sheet).std() > 20


def test_json_and_options(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--count", 12, "--no-objects-beside", "--no-covers", "--no-truncate", "--json"]
    report = said(cadpose(*synth(small_library, out, *options)))
    assert sum(report.pop("objects").values()) == 12
    assert report == {"out": str(out), "photos": 12, "drawn": 12, "truncated": 0, "occluded": 0}
    again = said(cadpose(*synth(small_library, out, *options, "--resume")))
    assert again["drawn"] == 0 and again["photos"] == 12
    assert json.loads((out / "recipe.json").read_text())["options"]["company"] == 0


def test_backgrounds_are_used(small_library: Library, tmp_path: Path) -> None:
    Image.new("RGB", (80, 60), (0, 255, 0)).save(tmp_path / "green.png")
    plain = [
        "--count",
        24,
        "--no-objects-beside",
        "--no-covers",
        "--no-flaws",
        "--no-shadows",
        "--format",
        "png",
    ]
    result = cadpose(*synth(small_library, tmp_path / "out", "--backgrounds", tmp_path, *plain))
    assert result.exit_code == 0, result.output
    corners = [np.asarray(Image.open(p))[0, 0].tolist() for p in sorted((tmp_path / "out/photos").iterdir())]
    assert 8 <= corners.count([0, 255, 0]) < 24


def test_only_held_out_models(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    hatch = next(m.id for m in small_library.models() if m.id.endswith("hatch.obj"))
    monkeypatch.setattr(held_out, "read_held_out", lambda lookalikes: {"car": frozenset({hatch})})
    said(cadpose(*synth(small_library, tmp_path / "out", "--held-out", "--count", 6, "--json")))
    shown = [json.loads(line)["cad"] for line in (tmp_path / "out/labels.jsonl").read_text().splitlines()]
    assert len(shown) >= 6 and set(shown) == {hatch}
    monkeypatch.setattr(held_out, "read_held_out", lambda lookalikes: {"car": frozenset({"other"})})
    one_sentence(cadpose(*synth(small_library, tmp_path / "b", "--held-out")), "none of the held-out models")
    chairs = synth(small_library, tmp_path / "c", "--held-out", "--category", "chair")
    one_sentence(cadpose(*chairs), "which are of car")


def test_mistakes(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    one_sentence(cadpose(*synth(small_library, out, "--backgrounds", tmp_path / "no")), tmp_path / "no")
    one_sentence(cadpose(*synth(small_library, out, "--backgrounds", tmp_path)), "holds no photo")
    one_sentence(cadpose(*synth(small_library, out, "--category", "boat")), "'boat'", "car, chair")
    one_sentence(cadpose("synth", out, "--library", tmp_path), "no CAD library", tmp_path)
    one_sentence(cadpose(*synth(small_library, out, "--hdri", tmp_path)), "--renderer blender")
    nowhere = {"CADPOSE_BLENDER": str(tmp_path)}
    missing = cadpose(*synth(small_library, out, "--renderer", "blender"), env=nowhere)
    one_sentence(missing, "cadpose blender setup")
    Library.create(tmp_path / "empty")
    one_sentence(cadpose("synth", out, "--library", tmp_path / "empty"), "is empty")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "a.txt").write_text("a")
    one_sentence(cadpose(*synth(small_library, tmp_path / "full")), "holds other files")
    for wrong in (["--count", 0], ["--size", 8], ["--format", "gif"], ["--warp", -1], ["--workers", 0]):
        assert cadpose(*synth(small_library, out, *wrong)).exit_code == 2, wrong
    assert not out.exists()
