"""Pix3D on a miniature tree, and on three of its real photos where they are there."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets.labels import mask_in_photo, object_in_photo
from cadpose.datasets.pix3d import pix3d
from cadpose.errors import InputError
from cadpose.geometry.angles import azimuth_error, geodesic_degrees
from cadpose.geometry.boxes import Box
from cadpose.geometry.labels import from_pix3d
from tests.datasets.trees import camera_rotation, pix3d_tree


def test_every_field(tmp_path: Path) -> None:
    (label,) = pix3d(pix3d_tree(tmp_path, {"occluded": False, "slightly_occluded": True}))
    assert (label.category, label.cad) == ("bed", "pix3d/model/bed/IKEA_MALM_2/model.obj")
    assert label.box == Box(10, 20, 70, 60)
    assert (label.focal_px, label.principal_px) == (120.0, (60.0, 40.0))
    assert label.t_cv == pytest.approx((-0.4, -0.1, 2.0))
    assert (label.occluded, label.truncated, label.split, label.source) == (True, False, None, "pix3d")
    photo, box = object_in_photo(label)
    mask = mask_in_photo(label, photo)
    assert mask is not None and Box.from_mask(mask) == box


def test_an_object_off_the_middle_is_turned_towards_the_viewer(tmp_path: Path) -> None:
    (label,) = pix3d(pix3d_tree(tmp_path))
    assert label.rotation is not None
    x, y, z = 0.4, 0.1, 2.0
    turned = geodesic_degrees(camera_rotation(label), label.rotation.to_matrix())
    assert turned == pytest.approx(np.rad2deg(np.arctan(np.hypot(x, y) / z)))
    (middle,) = pix3d(pix3d_tree(tmp_path, {"trans_mat": [0, 0, 2], "cam_position": [0, 0, -2]}))
    assert middle.rotation is not None
    np.testing.assert_allclose(middle.rotation.to_matrix(), camera_rotation(middle), atol=1e-12)


def test_published_means_unoccluded_and_untruncated(tmp_path: Path) -> None:
    flags = ("truncated", "occluded", "slightly_occluded")
    root = pix3d_tree(tmp_path, {}, *({flag: True} for flag in flags))
    assert (len(list(pix3d(root))), len(list(pix3d(root, published=True)))) == (4, 1)
    with pytest.raises(InputError, match="pix3d has no split 'val': it has none"):
        pix3d(root, "val")


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"img": "../secret.png"}, "does not lie in"),
        ({"mask": "/etc/passwd"}, "does not lie in"),
        ({"img": 5}, "img must be a word"),
        ({"img_size": [0, 10]}, "no size of a photo"),
        ({"img_size": [10**9, 10]}, "no size of a photo"),
        ({"img_size": [10**400, 10]}, "img_size must hold 2 finite numbers"),
        ({"rot_mat": [[1, 0, 0]]}, "rot_mat must hold 3 x 3"),
        ({"rot_mat": [[1, 0, 0], [0, 1], [0]]}, "entry 0"),
        ({"rot_mat": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "R is not a rotation matrix"),
        ({"rot_mat": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}, "R is not a rotation matrix"),
        ({"trans_mat": ["a", 1, 2]}, "trans_mat must hold 3"),
        ({"trans_mat": [0, 0, -1]}, "must lie before the camera"),
        ({"focal_length": 0}, "focal_length 0.0 must be above 0"),
        ({"focal_length": None}, "focal_length must hold one"),
        ({"bbox": [10, 10, 5, 20]}, "is empty"),
        ({"truncated": "yes"}, "truncated must be true or false"),
    ],
)
def test_a_wrong_entry_is_told(tmp_path: Path, changes: dict[str, Any], told: str) -> None:
    root = pix3d_tree(tmp_path, changes, {})
    with pytest.raises(InputError, match=told) as caught:
        list(pix3d(root))
    assert str(root / "pix3d.json") in str(caught.value)
    bad: list[InputError] = []
    assert len(list(pix3d(root).labels(bad.append))) == 1 and len(bad) == 1


def test_a_missing_field_is_named(tmp_path: Path) -> None:
    root = pix3d_tree(tmp_path)
    (entry,) = json.loads((root / "pix3d.json").read_text())
    for key in (
        "img",
        "category",
        "img_size",
        "mask",
        "model",
        "rot_mat",
        "trans_mat",
        "focal_length",
        "bbox",
    ):
        (root / "pix3d.json").write_text(json.dumps([{k: v for k, v in entry.items() if k != key}]))
        with pytest.raises(InputError, match=f"entry 0 lacks '{key}'"):
            list(pix3d(root))
    (root / "pix3d.json").write_text("{}")
    with pytest.raises(InputError, match="expected an array"):
        pix3d(root)


def test_three_real_photos(bench: Path) -> None:
    root = bench / "bench" / "pix3d_beds"
    if not root.is_dir():
        pytest.skip(f"needs the three Pix3D photos: no folder {root}")
    labels = list(pix3d(root))
    assert len(labels) == 3
    for label, entry in zip(labels, json.loads((root / "pix3d.json").read_text()), strict=True):
        photo, box = object_in_photo(label)
        assert [photo.width, photo.height] == entry["img_size"]
        mask = mask_in_photo(label, photo)
        assert mask is not None
        np.testing.assert_allclose(Box.from_mask(mask).to_tuple(), box.to_tuple(), atol=1.0)
        arrays = [np.array(entry[key]) for key in ("rot_mat", "trans_mat", "cam_position")]
        camera = from_pix3d(arrays[0], arrays[1], entry["focal_length"], tuple(entry["img_size"]), arrays[2])
        np.testing.assert_allclose(camera_rotation(label), camera.R_cv_from_s)
        # Pix3D's authors give the viewpoint by where the camera stands, seen from the model's origin.
        assert label.azimuth is not None
        assert azimuth_error(label.azimuth, camera.azimuth) < 1e-3
        assert label.elevation == pytest.approx(camera.elevation, abs=1e-3)
        # Off the middle that differs visibly from the rotation in the photo's own camera.
        assert label.rotation is not None
        assert geodesic_degrees(camera_rotation(label), label.rotation.to_matrix()) > 1.0
