"""BOP's layout on a miniature tree."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets.bop import bop
from cadpose.datasets.labels import mask_in_photo, object_in_photo, read_labels, write_labels
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import R_b_from_s
from tests.datasets.trees import bop_tree, camera_rotation


def test_every_field(tmp_path: Path) -> None:
    first, second, third = bop(bop_tree(tmp_path / "ycbv"))
    assert first.photo == tmp_path / "ycbv/test/000048/rgb/000001.png"
    assert (first.category, first.cad) == ("obj_000005", "bop/ycbv/obj_000005")
    assert (first.cad_path, first.cad_axes) == (tmp_path / "ycbv/models/obj_000005.ply", ("+y", "+z"))
    assert first.cad_diagonal == pytest.approx(np.linalg.norm([100.0, 40.0, 60.0]))
    assert first.box == Box(10, 20, 70, 60)
    assert (first.focal_px, first.principal_px) == (150.0, (60.0, 40.0))
    assert first.t_cv == (40.0, -10.0, 500.0)
    assert (first.split, first.source) == ("test", "bop")
    assert (first.occluded, first.difficult) == (False, False)
    assert (second.occluded, second.difficult, second.mask) == (True, True, None)
    assert third.split == "train" and third.photo.parent.parent.parent.name == "train_pbr"
    photo, box = object_in_photo(first)
    mask = mask_in_photo(first, photo)
    assert mask is not None and Box.from_mask(mask) == box


def test_the_pose_is_that_of_the_models_file(tmp_path: Path) -> None:
    """A point of the PLY file lands where BOP's matrices put it."""
    root = bop_tree(tmp_path)
    label = next(iter(bop(root)))
    gt = json.loads((root / "test/000048/scene_gt.json").read_text())["1"][0]
    point = np.array([12.0, -7.0, 30.0])
    theirs = np.array(gt["cam_R_m2c"]).reshape(3, 3) @ point + gt["cam_t_m2c"]
    ours = camera_rotation(label) @ R_b_from_s.T @ point + np.array(label.t_cv)
    np.testing.assert_allclose(ours, theirs, atol=1e-12)


def test_angles_are_seen_along_the_line_of_sight(tmp_path: Path) -> None:
    """A model on the axis, its front (+y) towards the camera and its top up, is seen from the front."""
    front = [1.0, 0, 0, 0, 0, -1.0, 0, 1.0, 0]  # x right, z up, y away: the back is seen
    label = next(iter(bop(bop_tree(tmp_path, cam_R_m2c=front, cam_t_m2c=[0, 0, 500]))))
    assert (label.azimuth, label.elevation, label.inplane) == pytest.approx((180.0, 0.0, 0.0), abs=1e-9)


def test_splits_and_what_is_published(tmp_path: Path) -> None:
    root = bop_tree(tmp_path)
    assert [len(list(bop(root, split))) for split in ("test", "train", "train_pbr")] == [2, 1, 1]
    assert len(list(bop(root, published=True))) == 2
    with pytest.raises(InputError, match="no split 'val' here: it has test, train_pbr"):
        bop(root, "val")


def test_labels_come_back_from_a_label_file(tmp_path: Path) -> None:
    labels = list(bop(bop_tree(tmp_path / "set")))
    write_labels(tmp_path / "l.jsonl", labels)
    assert read_labels(tmp_path / "l.jsonl") == labels
    entry = json.loads((tmp_path / "l.jsonl").read_text().splitlines()[0])
    assert (entry["model"], entry["model_axes"]) == ("set/models/obj_000005.ply", ["+y", "+z"])


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"cam_t_m2c": [0, 0, -5]}, "must lie before the camera"),
        ({"cam_t_m2c": [0, 0]}, "cam_t_m2c must hold 3 finite numbers"),
        ({"cam_R_m2c": [2.0, 0, 0, 0, 1, 0, 0, 0, 1]}, "not a rotation"),
        ({"obj_id": 77}, "lacks '77'"),
        ({"obj_id": "x"}, "invalid literal"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        list(bop(bop_tree(tmp_path, **changes)))
    assert "scene_gt.json: image 1, object 0" in str(caught.value)


def test_cameras_that_cannot_be_told(tmp_path: Path) -> None:
    root = bop_tree(tmp_path)
    file = root / "test/000048/scene_camera.json"
    for K, words in (
        ([150, 1, 60, 0, 150, 40, 0, 0, 1], "cam_K must be"),
        ([150, 0, 60, 0, 170, 40, 0, 0, 1], "only square pixels"),
    ):
        file.write_text(json.dumps({"1": {"cam_K": K}}))
        with pytest.raises(InputError, match=words):
            list(bop(root))


def test_folders_that_lack_something(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no scene of BOP"):
        bop(tmp_path)
    root = bop_tree(tmp_path / "set")
    (root / "test/000048/rgb/000001.png").unlink()
    with pytest.raises(InputError, match="holds no picture 000001"):
        list(bop(root))
    (root / "models/models_info.json").rename(root / "m.json")
    with pytest.raises(InputError, match=r"no models/models_info\.json"):
        bop(root)
