"""`cadpose experiment paper`."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.evaluation import figures
from cadpose.library.catalogue import Library
from tests.cli.invoking import cadpose, one_sentence, said


def paper(library: Library, out: Path, *options: object) -> list[object]:
    small = ["--models", 2, "--photos", 2, "--size", 64, "--workers", 1, "--category", "car"]
    return ["experiment", "paper", out, "--library", library.path, *small, *options]


def test_a_quick_look(small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "_DPI", 60)
    out, report = tmp_path / "out", tmp_path / "report.html"
    options = ["--boxes", "true", "--rotation", "true", "--measure", "sm2"]
    nowhere = {"CADPOSE_BLENDER": str(tmp_path / "none")}
    result = cadpose(*paper(small_library, out, *options, "--report", report), env=nowhere)
    assert result.exit_code == 0, result.output
    assert "the rasteriser draws: a quick look only" in result.stderr
    assert result.stdout.startswith("CAD retrieval, SYNTHETIC photos (drawn with the rasteriser): out/")
    assert "THE PAPER'S Table 2" in result.stdout and report.is_file()
    arguments = paper(small_library, out, *options, "--renderer", "raster", "--resume", "--json")
    told = said(cadpose(*arguments))
    assert told["synthetic"] is True and told["measures"]["sm2"]["photos"] == 2


def test_mistakes(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    one_sentence(cadpose(*paper(small_library, out, "--renderer", "raster", "--category", "boat")), "boat")
    nowhere = {"CADPOSE_BLENDER": str(tmp_path)}
    one_sentence(cadpose(*paper(small_library, out, "--renderer", "blender"), env=nowhere), "blender setup")
    arguments = ["experiment", "paper", out, "--library", small_library.path, "--renderer", "raster"]
    one_sentence(cadpose(*arguments), "bed 0", "cadpose library add parametric")
    one_sentence(
        cadpose(*paper(small_library, out, "--renderer", "raster", "--report", tmp_path)), "a folder"
    )
    for inside in ("recipe.json", "gallery.json", "labels.jsonl", "evaluation", "evaluation/tables.txt", "."):
        told = cadpose(*paper(small_library, out, "--report", out / inside))
        one_sentence(told, "for OUT already: choose another --report")
    told = cadpose(*paper(small_library, out, "--report", out / "photos" / "car" / "0.png"))
    one_sentence(told, "which this run reads: choose another --report")
    told = cadpose(*paper(small_library, out, "--backgrounds", tmp_path, "--report", tmp_path / "0.png"))
    one_sentence(told, "which this run reads: choose another --report")
    flagged = cadpose(*paper(small_library, out, "--rotation", "true", "--reject-flagged"))
    assert flagged.exit_code == 2 and "--reject-flagged needs" in flagged.stderr
    for wrong in (["--models", 1], ["--photos", 0], ["--boxes", "mine"], ["--measure", "sm9"]):
        assert cadpose(*paper(small_library, out, *wrong)).exit_code == 2, wrong
    assert not out.exists()
