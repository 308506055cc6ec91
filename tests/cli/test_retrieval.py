"""`cadpose evaluate retrieval`."""

from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from typer.testing import Result

from cadpose.evaluation import figures
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo, Rotation
from tests.batch.fakes import FakeDetector, fake_annotator
from tests.cli.invoking import cadpose, one_sentence, said
from tests.small_library import save, shoot

TRUE = Rotation(35, 12, 4)
Write = Callable[..., Path]


@pytest.fixture(scope="module")
def photos(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo of each car and each chair, and their labels."""
    folder = tmp_path_factory.mktemp("set")
    entries = []
    for i, cad in enumerate(small_library.models()):
        shot = shoot(small_library, cad.id, TRUE)
        save(folder / f"{i}.png", shot.photo.rgb)
        entries.append(
            {
                "photo": f"{i}.png", "category": cad.category, "cad": cad.id,
                "box": list(shot.box.to_tuple()), "azimuth": 35, "elevation": 12, "inplane": 4,
            }
        )  # fmt: skip
    (folder / "labels.json").write_text(json.dumps(entries))
    return folder / "labels.json"


def evaluate(library: Library, labels: Path, *options: object) -> list[object]:
    return ["evaluate", "retrieval", labels, "--library", library.path, *options]


def changed(
    labels: Path, change: Callable[[list[dict[str, Any]]], object], name: str = "changed.json"
) -> Path:
    """Another label file beside it."""
    entries = json.loads(labels.read_text())
    change(entries)
    path = labels.with_name(name)
    path.write_text(json.dumps(entries))
    return path


def test_tables_of_two_measures(small_library: Library, photos: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    options = ["--measure", "aligned", "--measure", "sm2", "--rotation", "true", "--beside-paper"]
    result = cadpose(*evaluate(small_library, photos, *options, "--out", out, "--csv", tmp_path / "t.csv"))
    assert result.exit_code == 0 and not result.stderr, result.stderr
    text = result.stdout
    assert text.startswith(f"CAD retrieval, real photos: {photos.parent.name}/labels.json\n")
    assert "Measure aligned" in text and "car (3)" in text and "Total (5)" in text
    assert "Chance (%)" in text and "THE PAPER'S Table 2" in text and "THE PAPER'S Table 1" not in text
    assert sorted(p.name for p in out.iterdir()) == [
        "outcomes.jsonl", "settings.json", "tables.csv", "tables.json", "tables.txt",
    ]  # fmt: skip
    assert (out / "tables.txt").read_text(encoding="utf-8") == text
    assert (tmp_path / "t.csv").read_text() == (out / "tables.csv").read_text()
    rows = list(csv.DictReader((out / "tables.csv").open()))
    assert {row["photos_are"] for row in rows} == {"real", "published"}
    table = json.loads((out / "tables.json").read_text())["measures"]["aligned"]
    assert (table["n"], table["top1"], table["yield"]) == (5, 1.0, 1.0)
    assert table["baselines"]["chance"]["top1"] == pytest.approx((3 / 3 + 2 / 2) / 5)
    assert len((out / "outcomes.jsonl").read_text().splitlines()) == 5


def test_a_stopped_run_goes_on(small_library: Library, photos: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    arguments = evaluate(small_library, photos, "--rotation", "true", "--out", out)
    whole = cadpose(*arguments).stdout
    lines = (out / "outcomes.jsonl").read_text().splitlines(keepends=True)
    (out / "outcomes.jsonl").write_text("".join(lines[:2]) + lines[2][:30])
    again = cadpose(*arguments, "--resume")
    assert again.exit_code == 0 and again.stdout == whole
    assert (out / "outcomes.jsonl").read_text() == "".join(lines)
    one_sentence(cadpose(*arguments), out, "--resume")
    one_sentence(cadpose(*arguments, "--resume", "--seed", 1), "other settings (seed)")


def test_photos_that_are_missing_and_rotations_of_a_file(
    small_library: Library, photos: Path, tmp_path: Path
) -> None:
    def change(entries: list[dict[str, Any]]) -> None:
        entries[0]["photo"] = "gone.png"
        for entry in entries:
            del entry["azimuth"], entry["elevation"]

    path = changed(photos, change)
    result = cadpose(*evaluate(small_library, path, "--rotation", photos, "--json"))
    assert result.exit_code == 1 and "gone.png" in result.stderr and result.stderr.count("\n") == 1
    told = said(result)
    table = told["measures"]["aligned"]
    assert (table["n"], table["photos"], table["top1"]) == (4, 5, 1.0)
    assert table["end_to_end"]["top1"] == 0.8 and told["rotation"] == "of labels.json"
    assert [r["stage"] for r in table["rejected"]] == ["photo"]
    everything = cadpose(*evaluate(small_library, path, "--rotation", "true", "--json"))
    assert everything.exit_code == 1 and said(everything)["measures"]["aligned"]["n"] == 0


def test_what_the_detector_does_not_find_is_no_mistake(
    small_library: Library, photos: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is missed is told in the table, and the exit code is 0."""

    class Blind(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            return []

    def blind(*_: object, **__: object) -> Annotator:
        return fake_annotator(small_library, detector=Blind())

    monkeypatch.setattr("cadpose.cli.retrieval.make_annotator", blind)
    result = cadpose(
        *evaluate(small_library, photos, "--rotation", "true", "--boxes", "detected", "--limit", 1)
    )
    assert result.exit_code == 0 and not result.stderr
    assert "Boxes: detected" in result.stdout and "0 of 2 photos" in result.stdout
    assert "no object was found at the labelled box" in result.stdout


def test_galleries(small_library: Library, photos: Path, tmp_path: Path) -> None:
    gallery = tmp_path / "gallery.json"
    common = ["--rotation", "true", "--category", "car", "--gallery", gallery]
    ids = [m.id for m in small_library.models()]
    for content in (ids, {"Cars": ids[:3], "chair": ids[3:]}):
        gallery.write_text(json.dumps(content))
        told = said(cadpose(*evaluate(small_library, photos, *common, "--json")))
        assert told["measures"]["aligned"]["n"] == 3
    gallery.write_text(json.dumps(ids[:1]))
    result = cadpose(*evaluate(small_library, photos, *common))
    assert "2 photos whose true model is not among the candidates" in result.stdout
    for wrong, says in (
        ('["made/car/hatch"]', "made/car/hatch.obj"),
        ("[]", "expected a JSON array of CAD"),
        ('{"truck": ["made/car/hatch.obj"]}', "under truck"),
    ):
        gallery.write_text(wrong)
        one_sentence(cadpose(*evaluate(small_library, photos, *common)), says)


def test_synthetic_photos_say_so_and_stay_among_themselves(small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "drawn"
    drawn = cadpose(
        "synth", out, "--count", 12, "--size", 96, "--workers", 1, "--library", small_library.path,
        "--no-objects-beside", "--no-covers", "--no-truncate",
    )  # fmt: skip
    assert drawn.exit_code == 0
    result = cadpose(*evaluate(small_library, out / "labels.jsonl", "--rotation", "true", "--limit", 2))
    assert result.stdout.startswith("CAD retrieval, SYNTHETIC photos (drawn with the rasteriser): drawn/")
    assert "The same renderer drew photos and candidates" in result.stdout
    lines = (out / "labels.jsonl").read_text().splitlines()
    lines[0] = json.dumps(json.loads(lines[0]) | {"synthetic": False, "source": "mine"})
    (out / "mixed.jsonl").write_text("\n".join(lines))
    mixed = cadpose(*evaluate(small_library, out / "mixed.jsonl", "--rotation", "true"))
    one_sentence(mixed, "mixed.jsonl: holds 11 synthetic and 1 real photos")


def test_a_report(
    small_library: Library, photos: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(figures, "_DPI", 60)
    path = tmp_path / "report.html"
    result = cadpose(
        *evaluate(small_library, photos, "--rotation", "true", "--split", "odd", "--report", path)
    )
    assert result.exit_code == 0 and f"Report: {path}" in result.stdout
    html = path.read_text(encoding="utf-8")
    assert "CAD retrieval, real photos" in html and 'alt="Right answer"' in html and "car (2)" in html


def test_mistakes(small_library: Library, photos: Path, tmp_path: Path) -> None:
    one_sentence(cadpose(*evaluate(small_library, photos, "--report", photos)), "would be written over")
    one_sentence(cadpose(*evaluate(small_library, photos, "--csv", photos.parent / "0.png")), "0.png")
    one_sentence(cadpose(*evaluate(small_library, photos, "--report", tmp_path)), "is a folder")
    one_sentence(
        cadpose(*evaluate(small_library, changed(photos, lambda e: [x.pop("cad") for x in e]))), "cad"
    )
    for wrong in (["--measure", "sm9"], ["--limit", 0], ["--accept", 2], ["--resume"], ["--boxes", "none"]):
        assert cadpose(*evaluate(small_library, photos, *wrong)).exit_code == 2, wrong


def test_rotations_that_cannot_be(small_library: Library, photos: Path) -> None:
    for origin in ("true", photos):
        told = cadpose(*evaluate(small_library, photos, "--reject-flagged", "--rotation", origin))
        assert told.exit_code == 2 and "--reject-flagged needs" in told.stderr, told.output
    for word in ("guessed", photos.parent):
        told = cadpose(*evaluate(small_library, photos, "--rotation", word))
        assert told.exit_code == 2 and "true, predicted or a label file" in told.stderr, told.output


def test_no_output_takes_the_place_of_another(small_library: Library, photos: Path, tmp_path: Path) -> None:
    def refused(*options: object) -> Result:
        return cadpose(*evaluate(small_library, photos, "--rotation", "true", *options))

    one, out = tmp_path / "one", tmp_path / "out"
    again = tmp_path / "none" / ".." / "one"
    one_sentence(refused("--csv", one, "--report", again), "for --report already: choose another --csv")
    for name in ("tables.txt", "tables.csv", "tables.json", "settings.json", "outcomes.jsonl", "."):
        one_sentence(refused("--out", out, "--csv", out / name), "for --out already: choose another --csv")
    one_sentence(refused("--report", photos), "written over: choose another --report")
    assert not any(tmp_path.iterdir())
    # A folder of outcomes that would take a labelled mask's place.
    mask = photos.parent / "tables.json"
    path = changed(photos, lambda e: e[0].update(mask="tables.json"))
    told = cadpose(*evaluate(small_library, path, "--rotation", "true", "--out", photos.parent))
    one_sentence(told, mask, "written over: choose another --out")
