"""The paper's set-up from a small library, and what it says of itself."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from cadpose.datasets.gallery import read_gallery
from cadpose.errors import InputError, LibraryError
from cadpose.evaluation import paper_experiment
from cadpose.evaluation.paper_experiment import (
    PaperSetup,
    draw_paper_set,
    evaluate_paper_set,
    notes_on,
    paper_gallery,
    usual_renderer,
)
from cadpose.library.catalogue import Library
from cadpose.records import CadModel
from tests.batch.fakes import fake_annotator

SMALL = PaperSetup("raster", ("car", "chair"), models=2, photos=2, size=64)


class Spread(Library):
    """Representatives in an order of our own."""

    spread: tuple[CadModel, ...] = ()

    def categories(self) -> dict[str, int]:
        return {"car": len(self.spread)} if self.spread else {}

    def models(self, category: str | None = None) -> tuple[CadModel, ...]:
        return self.spread

    def representatives(self, category: str, count: int = 10) -> tuple[CadModel, ...]:
        return self.spread[:count]


def spread(*sources: str) -> Spread:
    library = Spread(Path("nowhere"))
    library.spread = tuple(CadModel(f"{i}", "x", "car", source) for i, source in enumerate(sources))
    return library


def test_sweet_home_3d_first_then_others_then_made_by_formula() -> None:
    library = spread("parametric", "sweethome3d:a.sh3f", "folder", "parametric", "sweethome3d:b.sh3f")
    chosen = paper_gallery(library, ["car"], 4)["car"]
    assert [model.id for model in chosen] == ["1", "4", "2", "0"]


def test_too_few_models_are_told_with_the_mend() -> None:
    with pytest.raises(LibraryError, match="needs 3 models that differ of each category") as caught:
        paper_gallery(spread("parametric", "sweethome3d"), ["car", "bench"], 3)
    said = str(caught.value)
    assert "car 2, bench 0" in said
    assert "`cadpose library add parametric --category car --category bench --limit 4`" in said


def test_settings_that_cannot_be() -> None:
    with pytest.raises(InputError, match=r"boat is none of the paper's categories: bag, bed"):
        PaperSetup("raster", ("car", "boat"))
    with pytest.raises(ValueError, match="at least 1"):
        PaperSetup("raster", photos=0)
    assert len(PaperSetup("blender").categories) == 10


def test_the_renderer_that_is_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CADPOSE_BLENDER", str(tmp_path))
    assert usual_renderer() == "raster"
    monkeypatch.setattr(paper_experiment, "blender_python", lambda: tmp_path)
    assert usual_renderer() == "blender"


def test_from_a_library_to_the_tables(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "paper"
    gallery = draw_paper_set(SMALL, out, small_library)
    assert sorted(p.name for p in out.iterdir()) == ["gallery.json", "labels.jsonl", "photos", "recipe.json"]
    read = read_gallery(out / "gallery.json")
    assert read.ids == tuple(cad.id for models in gallery.values() for cad in models) and len(read.ids) == 4
    annotator = fake_annotator(small_library)
    tables, outcomes = evaluate_paper_set(
        out, gallery, annotator, measures=("sm2",), rotation="true", boxes="true"
    )
    assert tables.title == "CAD retrieval, SYNTHETIC photos (drawn with the rasteriser): paper/labels.jsonl"
    assert [row.photos for row in tables.tables[0].rows] == [2, 2] and len(outcomes) == 4
    assert all(len(outcome.candidates) == 2 for outcome in outcomes)
    text = (out / "evaluation" / "tables.txt").read_text(encoding="utf-8")
    assert "THE PAPER'S Table 2: SM2" in text and "THE PAPER'S Table 4" in text
    assert "The paper's set-up with other models (4 other files)" in text and "held out" not in text
    # Again: nothing is drawn, nothing is ranked, the same is told.
    photo = next((out / "photos").rglob("*.jpg"))
    stamp = photo.stat().st_mtime_ns
    assert draw_paper_set(SMALL, out, small_library, resume=True) == gallery
    again, _ = evaluate_paper_set(
        out, gallery, annotator, measures=("sm2",), rotation="true", boxes="true", resume=True
    )
    assert again.to_text() == tables.to_text() == text and photo.stat().st_mtime_ns == stamp


def test_folders_that_are_not_its_own(small_library: Library, tmp_path: Path) -> None:
    draw_paper_set(SMALL, tmp_path / "a", small_library)
    with pytest.raises(InputError, match="holds an experiment already: add --resume"):
        draw_paper_set(SMALL, tmp_path / "a", small_library)
    other = PaperSetup("raster", ("car", "chair"), models=2, photos=3, size=64)
    with pytest.raises(InputError, match=r"made with other settings \(photos\)"):
        draw_paper_set(other, tmp_path / "a", small_library, resume=True)
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="holds other files"):
        draw_paper_set(SMALL, tmp_path / "b", small_library, resume=True)
    with pytest.raises(InputError, match="is a file"):
        draw_paper_set(SMALL, tmp_path / "b" / "notes.txt", small_library)


def test_what_the_network_may_have_seen_is_told() -> None:
    held = "Scopia/scopia/captains-bed/captains-bed.obj"
    bed = CadModel(held, "x", "bed", "sweethome3d:Scopia.sh3f")
    made = CadModel("parametric/bed/000", "x", "bed", "parametric")
    first, second = notes_on({"bed": (bed, made)}, "predicted")
    assert "1 Sweet Home 3D, 1 made by formula" in first
    assert "Of the 2 models 1 were held out" in second
    assert len(notes_on({"bed": (bed, made)}, "true")) == 1


def test_it_needs_no_torch() -> None:
    listing = "import cadpose.evaluation.paper_experiment, sys, json; print(json.dumps(list(sys.modules)))"
    run = subprocess.run([sys.executable, "-c", listing], capture_output=True, text=True, check=True)
    assert "torch" not in json.loads(run.stdout)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"categories": ("car", "car")}, "each once"),
        ({"categories": ()}, "at least one category"),
        ({"renderer": "crayon"}, "must be one of blender, raster"),
        ({"size": 16}, "size must lie between 32 and 4096, got 16"),
        ({"size": 5000}, "size must lie"),
        ({"samples": 0}, "samples must lie between 1 and 4096, got 0"),
        ({"seed": -1}, "seed must not be negative"),
    ],
)
def test_setups_that_cannot_be(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        replace(SMALL, **changes)
