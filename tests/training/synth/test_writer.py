"""The folder: the same bytes by whatever way, and label files that read back."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from cadpose.datasets.labels import mask_in_photo, read_labels
from cadpose.detection.coco_json import FileDetector
from cadpose.errors import CadposeError, InputError, LibraryError
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.training.synth import writer
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.writer import COCO, LABELS, MODELS, PARTS, PHOTOS, write_photos
from tests.training.synth.making import recipe_of


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.fixture(scope="module")
def made(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sixty photos of the recipe that the tests make in other ways."""
    out = tmp_path_factory.mktemp("synth") / "made"
    write_photos(recipe_of(small_library), out, 60)
    return out


def test_what_is_there(made: Path, small_library: Library) -> None:
    assert sorted(p.name for p in made.iterdir()) == [
        "coco.json", "labels.jsonl", "models.json", "parts", "photos", "recipe.json",
    ]  # fmt: skip
    assert len(list((made / PHOTOS).iterdir())) == 60
    models = json.loads((made / MODELS).read_text())
    assert {m["cad"] for m in models} <= {m.id for m in small_library.models()}
    assert all(isinstance(SymmetryGroup.from_json(m["symmetry"]), SymmetryGroup) for m in models)


def test_labels_are_what_was_drawn(made: Path, small_library: Library) -> None:
    """Label file and generator agree, through JSON and run lengths."""
    labels = read_labels(made / LABELS)
    generator = recipe_of(small_library).generator()
    drawn = [(i, found) for i in range(60) for found in generator.photo(i).objects]
    assert len(labels) == len(drawn) > 60
    for label, (index, found) in zip(labels, drawn, strict=True):
        assert label.photo == made / PHOTOS / f"{index:07d}.jpg" and label.source == "synth"
        assert label.synthetic
        assert (label.cad, label.category) == (found.cad, found.category)
        assert label.rotation is not None and label.rotation.error_to(found.rotation) < 1e-4
        assert label.K is not None and label.box is not None and label.t_cv is not None
        np.testing.assert_allclose(label.K, found.K, atol=1e-4)
        np.testing.assert_allclose(label.box.to_tuple(), found.box.to_tuple(), atol=1e-4)
        np.testing.assert_allclose(label.t_cv, (0, 0, found.t_z), atol=1e-5)
        assert label.R_cv_from_s is not None
        np.testing.assert_allclose(np.array(label.R_cv_from_s), found.rotation.to_matrix(), atol=1e-6)
        assert (label.truncated, label.occluded) == (found.truncated, found.occluded)
        mask = mask_in_photo(label, read_photo(label.photo))
        assert mask is not None and np.array_equal(mask, found.mask)


def test_coco_is_read_as_detections(made: Path) -> None:
    labels = read_labels(made / LABELS)
    detector = FileDetector(made / COCO)
    coco = json.loads((made / COCO).read_text())
    assert [i["file_name"] for i in coco["images"]] == [f"photos/{i:07d}.jpg" for i in range(60)]
    assert len(coco["annotations"]) == len(labels)
    checked = 0
    for image in coco["images"][:20]:
        path = made / image["file_name"]
        photo = read_photo(path)
        found = {d.box.to_tuple(): d for d in detector.detect(photo)}
        for label in (entry for entry in labels if entry.photo == path):
            mask = mask_in_photo(label, photo)
            assert mask is not None
            rows, columns = np.nonzero(mask)
            x0, y0, x1, y1 = columns.min(), rows.min(), columns.max() + 1, rows.max() + 1
            detection = found[float(x0), float(y0), float(x1), float(y1)]
            assert detection.category == label.category and detection.mask is not None
            assert np.array_equal(detection.mask, mask)
            assert detection.rotation is not None and label.rotation is not None
            assert detection.rotation.error_to(label.rotation) < 1e-4
            checked += 1
    assert checked >= 20


@pytest.mark.slow
def test_the_number_of_workers_changes_no_byte(made: Path, small_library: Library, tmp_path: Path) -> None:
    write_photos(recipe_of(small_library), tmp_path / "two", 60, workers=2)
    assert content(tmp_path / "two") == content(made)


def test_resuming_draws_only_what_is_missing(made: Path, small_library: Library, tmp_path: Path) -> None:
    out, recipe = tmp_path / "out", recipe_of(small_library)
    assert write_photos(recipe, out, 30).drawn == 30
    stamps = {p: p.stat().st_mtime_ns for p in (out / PHOTOS).iterdir()}
    lost = out / PHOTOS / "0000007.jpg"
    lost.unlink()
    report = write_photos(recipe, out, 60, resume=True)
    assert (report.drawn, report.photos) == (31, 60)
    assert all(p.stat().st_mtime_ns == t for p, t in stamps.items() if p != lost)
    assert content(out) == content(made)
    assert write_photos(recipe, out, 60, resume=True).drawn == 0


def test_a_cut_photo_and_a_damaged_part_are_made_again(
    made: Path, small_library: Library, tmp_path: Path
) -> None:
    out, recipe = tmp_path / "out", recipe_of(small_library)
    write_photos(recipe, out, 60)
    (out / PHOTOS / "0000030.jpg").write_bytes(b"cut")
    (out / PARTS / "000000.json").write_text('{"photos": [')
    assert write_photos(recipe, out, 60, resume=True).drawn == 25
    assert content(out) == content(made)


def test_a_killed_run_goes_on(made: Path, small_library: Library, tmp_path: Path) -> None:
    out = tmp_path / "out"
    recipe = recipe_of(small_library)
    script = (
        "import sys\nfrom pathlib import Path\n"
        "from cadpose.training.synth.options import SynthOptions\n"
        "from cadpose.training.synth.recipe import Recipe\n"
        "from cadpose.training.synth.writer import write_photos\n"
        f"recipe = Recipe(Path({str(recipe.library)!r}), {recipe.models!r}, None, SynthOptions(size=96), 3)\n"
        f"write_photos(recipe, Path({str(out)!r}), 100_000)\n"
    )
    run = subprocess.Popen([sys.executable, "-c", script])
    deadline = time.monotonic() + 120.0
    while not (out / PARTS / "000000.json").exists() and time.monotonic() < deadline:
        time.sleep(0.02)
    run.send_signal(signal.SIGKILL)
    run.wait()
    there = len(list((out / PHOTOS).glob("[0-9]*.jpg")))
    assert 24 <= there < 100_000 and not (out / LABELS).exists()
    count = max(60, there)
    report = write_photos(recipe, out, count, resume=True)
    assert report.photos == count and report.drawn <= count - 24
    assert not list(out.rglob(".part-*"))
    whole = content(out)
    if count == 60:
        assert whole == content(made)
    else:
        assert all(whole[name] == data for name, data in content(made).items() if name.endswith(".jpg"))


@pytest.mark.slow
def test_a_killed_worker_is_told_in_a_sentence(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Each worker ends like one that the system kills: without a word, as it starts.
    monkeypatch.setattr(writer, "_start", _die)
    with pytest.raises(CadposeError, match=r"was killed.*fewer --workers"):
        write_photos(recipe_of(small_library), tmp_path / "out", 60, workers=2)


def _die(*_: object) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def test_png_holds_the_very_pixels(small_library: Library, tmp_path: Path) -> None:
    write_photos(recipe_of(small_library), tmp_path / "out", 3, format="png")
    bgr = np.asarray(cv2.imread(str(tmp_path / "out" / PHOTOS / "0000002.png")))
    assert np.array_equal(bgr[..., ::-1], recipe_of(small_library).generator().photo(2).rgb)


def test_folders_that_cannot_be_used(made: Path, small_library: Library, tmp_path: Path) -> None:
    recipe = recipe_of(small_library)
    with pytest.raises(InputError, match="add --resume"):
        write_photos(recipe, made, 60)
    with pytest.raises(InputError, match=r"other settings \(seed"):
        write_photos(replace(recipe, seed=9), made, 60, resume=True)
    with pytest.raises(InputError, match=r"other settings \(format"):
        write_photos(recipe, made, 60, format="png", resume=True)
    with pytest.raises(InputError, match="60 photos already"):
        write_photos(recipe, made, 30, resume=True)
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(InputError, match="other files"):
        write_photos(recipe, tmp_path, 3)
    with pytest.raises(InputError, match="is a file"):
        write_photos(recipe, tmp_path / "mine.txt", 3)
    with pytest.raises(ValueError, match="at least 1"):
        write_photos(recipe, tmp_path / "out", 0)


def test_recipes_that_cannot_be_drawn(small_library: Library, tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match="'boat' to draw, it has car, chair"):
        Recipe.from_library(small_library, ["boat"])
    with pytest.raises(InputError, match="no folder"):
        Recipe.from_library(small_library, backdrops=tmp_path / "none")
    with pytest.raises(InputError, match="holds no photo"):
        Recipe.from_library(small_library, backdrops=tmp_path)
    (tmp_path / "bad.jpg").write_bytes(b"no picture")
    with pytest.raises(InputError, match="holds no photo"):
        Recipe.from_library(small_library, backdrops=tmp_path).generator()
