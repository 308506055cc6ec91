"""PASCAL3D+ on a miniature tree in its own file formats."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets import matlab
from cadpose.datasets.labels import Label, object_in_photo
from cadpose.datasets.objectnet3d import objectnet3d
from cadpose.datasets.pascal3d import pascal3d
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray
from cadpose.records import Rotation
from tests.datasets.trees import (
    EMPTY,
    YES,
    camera_rotation,
    objectnet3d_tree,
    pascal3d_tree,
    thing,
    view,
    write_mat,
)

pytest.importorskip("scipy")


def read(tmp_path: Path, *things: dict[str, Any], published: bool = False, split: str = "val") -> list[Label]:
    """Labels of one photo of the split with these objects."""
    root = pascal3d_tree(tmp_path)
    name = "2008_000002" if split == "val" else "2008_000001"
    write_mat(root / "Annotations" / "car_pascal" / f"{name}.mat", things)
    return [label for label in pascal3d(root, split, published) if label.photo.stem == name]


def test_every_field(tmp_path: Path) -> None:
    (label,) = read(tmp_path, thing(truncated=YES, difficult=YES))
    assert label.photo == tmp_path / "Images" / "car_pascal" / "2008_000002.jpg"
    assert (label.category, label.cad, label.source, label.split) == (
        "car",
        "pascal3d/car/03",
        "pascal3d",
        "val",
    )
    assert label.box == Box(10.0, 20.0, 110.0, 70.0)
    assert label.rotation == Rotation(95.5, 12.25, -3.5)
    assert (label.focal_px, label.principal_px, label.t_cv) == (3000.0, (59.5, 39.5), (0.0, 0.0, 5.5))
    assert (label.truncated, label.occluded, label.difficult) == (True, False, True)
    photo, box = object_in_photo(label)
    assert (photo.width, photo.height) == (120, 80) and box == label.box


def projected_by_pascal3d(points_p: FloatArray, v: dict[str, float]) -> FloatArray:
    """The projection of the data set's own tools, pixels from 1 (project_3d.m and its Python followers)."""
    a, e, t = (np.deg2rad(v[key]) for key in ("azimuth", "elevation", "theta"))
    centre = v["distance"] * np.array([np.cos(e) * np.sin(a), -np.cos(e) * np.cos(a), np.sin(e)])
    a, e = -a, -(np.pi / 2 - e)
    Rz = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
    Rx = np.array([[1, 0, 0], [0, np.cos(e), -np.sin(e)], [0, np.sin(e), np.cos(e)]])
    m = v["viewport"] * v["focal"]
    x = (np.diag([m, m, -1.0]) @ Rx @ Rz @ (points_p - centre).T)[:3]
    x = x[:2] / x[2]
    x = np.array([[np.cos(t), -np.sin(t)], [np.sin(t), np.cos(t)]]) @ x
    return np.stack([x[0] + v["px"], -x[1] + v["py"]], axis=1)


def test_the_camera_projects_as_the_data_sets_own_tools_do(tmp_path: Path) -> None:
    v = view(azimuth=213.0, elevation=-17.0, theta=31.0, distance=3.7, focal=1.2)
    (label,) = read(tmp_path, thing(viewpoint=v))
    assert label.K is not None and label.t_cv is not None and label.rotation is not None
    points_p = np.random.default_rng(0).normal(scale=0.3, size=(20, 3))
    s_from_p = np.array([[-1, 0, 0], [0, 0, 1], [0, 1, 0]])
    cv = points_p @ s_from_p.T @ camera_rotation(label).T + label.t_cv
    pixels = cv @ label.K.T
    # A pixel centre that MATLAB calls (1, 1) is (0.5, 0.5) here.
    np.testing.assert_allclose(pixels[:, :2] / pixels[:, 2:], projected_by_pascal3d(points_p, v) - 0.5)
    np.testing.assert_allclose(label.rotation.to_matrix(), camera_rotation(label))


def test_a_coarse_viewpoint_gives_a_rotation_and_no_camera(tmp_path: Path) -> None:
    without = view(distance=0.0, azimuth=None, elevation=None, azimuth_coarse=135.0)
    left_at_zero = view(distance=0.0, azimuth=0.0, elevation=0.0, azimuth_coarse=135.0)
    for viewpoint in (without, left_at_zero):
        (label,) = read(tmp_path, thing(viewpoint=viewpoint))
        assert label.rotation == Rotation(135.0, 0.0, -3.5)
        assert label.K is None and label.t_cv is None and label.R_cv_from_s is None


def test_what_nobody_labelled_is_left_out(tmp_path: Path) -> None:
    person = thing(**{"class": "person", "viewpoint": EMPTY, "cad_index": EMPTY, "anchors": EMPTY})
    empty = thing(viewpoint=EMPTY)
    untouched = thing(viewpoint=view(azimuth=0.0, elevation=0.0, theta=0.0))
    (label,) = read(tmp_path, person, empty, untouched, thing(cad_index=EMPTY))
    assert label.cad is None and label.rotation == Rotation(95.5, 12.25, -3.5)


def test_splits_are_the_published_ones(tmp_path: Path) -> None:
    root = pascal3d_tree(tmp_path)
    splits = {label.photo.stem: label.split for label in pascal3d(root)}
    assert splits == {"n02814533_10": "train", "2008_000001": "train", "2008_000002": "val"}
    assert [label.photo.stem for label in pascal3d(root, "val")] == ["2008_000002"]
    assert len(pascal3d(root, "train")) == 2
    with pytest.raises(InputError, match="no split 'test': it has train, val"):
        pascal3d(root, "test")


def test_published_filters(tmp_path: Path) -> None:
    things = [
        thing(cad_index=1.0),
        thing(cad_index=2.0, difficult=YES),
        thing(cad_index=3.0, truncated=YES),
        thing(cad_index=4.0, occluded=YES),
        thing(cad_index=5.0, anchors=EMPTY),
        thing(cad_index=6.0, viewpoint=view(elevation=90.0)),
    ]
    for split, expected in (("val", "1"), ("train", "1345")):
        kept = read(tmp_path, *things, published=True, split=split)
        assert "".join(str(label.cad)[-1] for label in kept) == expected
        assert len(read(tmp_path, *things, split=split)) == 6


@pytest.mark.parametrize(
    ("broken", "told"),
    [
        (thing(bbox=np.array([[1.0, 2.0, 3.0]])), "object 0: has no bbox of four numbers"),
        (thing(bbox=np.array([[50.0, 2.0, 3.0, 4.0]])), "object 0: box .* is empty"),
        (thing(bbox=np.array([[1.0, 2.0, np.nan, 4.0]])), "object 0: box .* not finite"),
        (thing(**{"class": None}), "object 0 has no class"),
        (thing(viewpoint=view(elevation=np.inf)), "elevation is no number"),
        (thing(viewpoint=view(azimuth=1e300)), "azimuth is no number"),
        (thing(viewpoint=view(focal=-1.0)), "focal length -3000.0 must be above 0"),
    ],
)
def test_a_wrong_object_is_told_with_its_file(tmp_path: Path, broken: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        read(tmp_path, broken)
    assert "2008_000002.mat" in str(caught.value)
    root = tmp_path
    bad: list[InputError] = []
    # The other photos are read all the same.
    assert len(list(pascal3d(root).labels(bad.append))) == 2 and len(bad) == 1


def test_a_folder_that_is_something_else(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no photo of PASCAL3D"):
        pascal3d(tmp_path)
    root = pascal3d_tree(tmp_path)
    (root / "PASCAL/VOCdevkit/VOC2012/ImageSets/Main/car_val.txt").unlink()
    with pytest.raises(InputError, match=r"car_val\.txt: cannot be read"):
        pascal3d(root)


def test_annotations_that_are_no_mat_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = pascal3d_tree(tmp_path)
    file = root / "Annotations" / "car_pascal" / "2008_000002.mat"
    whole = file.read_bytes()
    hdf5 = whole[:124] + b"\x00\x02IM" + whole[128:]
    for data, told in (
        (b"", "is not a .mat file"),
        (b"\0" * 300, "is not a .mat file"),
        (whole[: len(whole) // 2], "2008_000002.mat"),
        (whole[:200] + b"\xff" * 40 + whole[240:], "2008_000002.mat"),
        (hdf5, "version 7.3"),
    ):
        file.write_bytes(data)
        with pytest.raises(InputError, match=told):
            list(pascal3d(root, "val"))
    file.unlink()
    with pytest.raises(InputError, match=r"2008_000002\.mat: cannot be read"):
        list(pascal3d(root, "val"))
    write_mat(file, [], objects="none")
    with pytest.raises(InputError, match="its record has no objects"):
        list(pascal3d(root, "val"))
    file.write_bytes(whole)
    monkeypatch.setattr(matlab, "MAX_BYTES", 100)
    with pytest.raises(InputError, match="larger than"):
        list(pascal3d(root, "val"))


def test_a_compressed_bomb_is_not_unpacked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(matlab, "MAX_UNPACKED", 2**20)
    root = pascal3d_tree(tmp_path)
    file = root / "Annotations" / "car_pascal" / "2008_000002.mat"
    bomb = io.BytesIO(file.read_bytes()[:128])
    bomb.seek(128)
    body = zlib.compress(b"\0" * 2**24)
    bomb.write(struct.pack("<II", 15, len(body)) + body)
    file.write_bytes(bomb.getvalue())
    with pytest.raises(InputError, match="unpacks to more than 1 MiB"):
        list(pascal3d(root, "val"))


def test_arrays_of_many_numbers_are_refused(tmp_path: Path) -> None:
    many = np.zeros(matlab.MAX_VALUES + 1, np.uint8)
    root = pascal3d_tree(tmp_path)
    file = root / "Annotations" / "car_pascal" / "2008_000002.mat"
    write_mat(file, [], objects=many)
    with pytest.raises(InputError, match=r"2008_000002\.mat.*more than 1000000 values"):
        list(pascal3d(root, "val"))


# -- ObjectNet3D ----------------------------------------------------------------------------------


def test_objectnet3d(tmp_path: Path) -> None:
    root = objectnet3d_tree(tmp_path)
    labels = list(objectnet3d(root))
    assert [(label.photo.name, label.split) for label in labels[::2]] == [
        ("n1_1.JPEG", "train"),
        ("n1_2.JPEG", "val"),
        ("n1_3.JPEG", "test"),
    ]
    first, second = list(objectnet3d(root, "val"))
    assert (first.category, first.cad) == ("cabinet", "objectnet3d/filing_cabinet/03")
    assert first.azimuth == 330.0
    assert (second.category, second.source) == ("ashtray", "objectnet3d")


def test_an_objectnet3d_list_may_not_leave_its_folder(tmp_path: Path) -> None:
    root = objectnet3d_tree(tmp_path)
    for name in ("../../etc/passwd", "/etc/passwd", "a/../../b", "a\\b"):
        (root / "Image_sets" / "val.txt").write_text(f"{name}\n")
        with pytest.raises(InputError, match=r"val\.txt: names the file"):
            objectnet3d(root, "val")
