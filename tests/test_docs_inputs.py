"""The example files in the documentation are files that the program takes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from cadpose.datasets.label_json import entry_from_label
from cadpose.datasets.labels import Label, read_labels
from cadpose.datasets.registry import KINDS
from cadpose.detection.coco_json import FileDetector
from cadpose.geometry.boxes import Box
from cadpose.library.folder import folder_items
from cadpose.records import Photo, Rotation
from tests.datasets.trees import camera_rotation

DOCS = Path(__file__).resolve().parent.parent / "docs"


def example(page: str, pattern: str) -> str:
    """The one part of a page that the pattern's group holds."""
    (found,) = re.findall(pattern, (DOCS / page).read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    return str(found)


def test_the_label_file(tmp_path: Path) -> None:
    path = tmp_path / "labels.json"
    path.write_text(example("evaluation.md", r"^```json\n(.*?)^```$"))
    (label,) = read_labels(path)
    assert label.photo == tmp_path / "photos" / "motorcycle.png"
    assert label.box == Box(100, 69, 685, 446)
    assert label.rotation == Rotation(275, 5)
    assert label.cad is not None


def test_the_line_of_a_jsonl_file(tmp_path: Path) -> None:
    entry = json.loads(example("datasets.md", r"^```json\n(.*?)^```$"))
    path = tmp_path / "labels.jsonl"
    path.write_text(json.dumps(entry) + "\n")
    (label,) = read_labels(path, "motorcycle", "val")
    assert label.rotation == Rotation(275, 5)
    assert label.mask == tmp_path / "masks" / "motorcycle.png"
    assert (label.focal_px, label.principal_px, label.t_cv) == (994.0, (370.5, 250.0), (0.05, 0.02, 2.1))
    # The example's object lies in the middle of its photo, near enough: both rotations are the same.
    np.testing.assert_allclose(camera_rotation(label), Rotation(275, 5).to_matrix(), atol=1e-6)
    # The table names every key of the example, and the example every key that is read.
    rows = re.findall(r"^\| (`[^|]*`) \|", (DOCS / "datasets.md").read_text(encoding="utf-8"), re.MULTILINE)
    named = {key for row in rows for key in re.findall(r"`(\w+)`", row)} - set(KINDS)
    # A model file of the data set's own is not in the example, whose model is the library's.
    assert named - {"model"} == set(entry) == set(entry_from_label(everything(tmp_path), str))


def everything(folder: Path) -> Label:
    """A label of which all is known."""
    identity = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    return Label(
        folder / "a.png", "car", Box(0, 0, 1, 1), "x", 0.0, 0.0, 0.0, folder / "m.png", 9.0, (1.0, 1.0),
        identity, (0.0, 0.0, 1.0), "val", True, True, True, "mine", True,
    )  # fmt: skip


def test_the_detections_file(tmp_path: Path) -> None:
    path = tmp_path / "coco.json"
    path.write_text(example("detection.md", r'^```json\n(\{\n  "images".*?)^```$'))
    photo = Photo(np.zeros((500, 741, 3), np.uint8), name="photos/motorcycle.png")
    (found,) = FileDetector(path).detect(photo)
    assert found.category == "motorbike"
    assert found.box == Box(100, 69, 685, 446)
    assert found.rotation == Rotation(275, 5)


def test_the_table_of_models(tmp_path: Path) -> None:
    folder = tmp_path / "mymodels"
    (folder / "chairs").mkdir(parents=True)
    for name in ("van.glb", "thing.ply", "chairs/stool_02.stl"):
        (folder / name).touch()
    text = example("library.md", r"^((?:    [^\n]*,[^\n]*\n){2,})")
    (folder / "models.csv").write_text(text.replace("    ", ""))
    problems: list[str] = []
    items = {item.id: item for item in folder_items(folder, problems=problems)}
    assert problems == []
    assert {i: (m.name, m.category, m.licence, m.creator) for i, m in items.items()} == {
        "mymodels/van.glb": ("Delivery van", "car", "CC0-1.0", "me"),
        "mymodels/thing.ply": ("thing", "other", "CC0-1.0", "me"),
        "mymodels/chairs/stool_02.stl": ("Bar stool", "chair", "CC0-1.0", "me"),
    }
    # The van's file looks along +x with y up; its front becomes -z, its left, the file's -z, becomes -x.
    turned = np.array(items["mymodels/van.glb"].R_s_from_file).reshape(3, 3)
    assert turned @ [1, 0, 0] == pytest.approx([0, 0, -1])
    assert turned @ [0, 0, 1] == pytest.approx([1, 0, 0])
