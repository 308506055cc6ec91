"""ImageNet3D on a miniature tree, and its pickles, which are read and never run."""

from __future__ import annotations

import io
import os
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets import inert_pickle
from cadpose.datasets.imagenet3d import imagenet3d
from cadpose.datasets.inert_pickle import read_object_array
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from tests.datasets.trees import camera_rotation, imagenet3d_tree, pose, write_npz, write_text


def test_every_field(tmp_path: Path) -> None:
    train, val = imagenet3d(imagenet3d_tree(tmp_path))
    assert train.photo == tmp_path / "images" / "bed" / "n02818832_13.JPEG"
    assert (train.split, val.split) == ("train", "val")
    assert (train.category, train.cad, train.source) == ("bed", "imagenet3d/bed/02", "imagenet3d")
    assert train.box == Box(10, 20, 70, 60)
    assert train.rotation is not None
    angles = (train.azimuth, train.elevation, train.inplane)
    assert angles == pytest.approx((90.0, -np.rad2deg(0.1), np.rad2deg(0.2)))
    assert (train.focal_px, train.principal_px, train.t_cv) == (2000.0, (41.5, 39.0), (0.0, 0.0, 4.0))
    np.testing.assert_allclose(camera_rotation(train), train.rotation.to_matrix())


def test_an_elevation_beyond_the_zenith_is_the_same_rotation(tmp_path: Path) -> None:
    over, plain = (
        next(iter(imagenet3d(imagenet3d_tree(tmp_path, pose(azimuth=a, elevation=e, theta=t)))))
        for a, e, t in ((1.0, np.pi - 0.3, 0.2), (1.0 + np.pi, 0.3, 0.2 + np.pi))
    )
    np.testing.assert_allclose(camera_rotation(over), camera_rotation(plain), atol=1e-9)
    assert over.elevation == pytest.approx(np.rad2deg(0.3))


def test_status(tmp_path: Path) -> None:
    states = ("status_good", "status_partially", "status_barely", "status_bad", None)
    poses = [pose(object_status=state) for state in states]
    root = imagenet3d_tree(tmp_path, *poses, pose(distance=0.0), pose(px=None))
    val = list(imagenet3d(root, "val"))
    assert [(label.occluded, label.difficult) for label in val] == [
        (False, False),
        (True, False),
        (True, True),
    ]
    assert [len(list(imagenet3d(root, split, published=True))) for split in ("train", "val")] == [3, 1]
    with pytest.raises(InputError, match="no split 'test'"):
        imagenet3d(root, "test")


@pytest.mark.parametrize(
    ("broken", "told"),
    [
        (pose(azimuth=None), "object 0 lacks 'azimuth'"),
        (pose(bbox=None), "object 0 lacks 'bbox'"),
        (pose(bbox=np.array([1.0, 2.0])), "bbox must hold four numbers"),
        (pose(bbox=np.array([9.0, 9.0, 1.0, 20.0])), "is empty"),
        (pose(viewport=0), "focal length 0.0 must be above 0"),
        (pose(elevation=float("nan")), "elevation is no number"),
        (pose(distance="far"), "distance is no number"),
        (pose(**{"class": 3}), "class must be a word"),
    ],
)
def test_a_wrong_object_is_told_with_its_file(tmp_path: Path, broken: dict[str, Any], told: str) -> None:
    root = imagenet3d_tree(tmp_path, broken)
    with pytest.raises(InputError, match=told) as caught:
        list(imagenet3d(root, "val"))
    assert "n02818832_14.npz: object 0" in str(caught.value)


def test_a_folder_or_a_list_that_is_something_else(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no photo of ImageNet3D"):
        imagenet3d(tmp_path)
    write_text(imagenet3d_tree(tmp_path) / "lists" / "bed_imagenet_val.txt", "../../etc/passwd")
    with pytest.raises(InputError, match=r"bed_imagenet_val\.txt: names the file"):
        imagenet3d(tmp_path)


# -- pickles as data ------------------------------------------------------------------------------


def npz(path: Path, pickled: bytes, header: bytes | None = None) -> Path:
    """An .npz whose array ``annotations`` has this pickle for content."""
    member = io.BytesIO()
    np.lib.format.write_array_header_1_0(member, {"descr": "|O", "fortran_order": False, "shape": (1,)})
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("annotations.npy", (header or member.getvalue()) + pickled)
    return path


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_plain_values_of_every_protocol(tmp_path: Path, protocol: int) -> None:
    value: dict[str, Any] = {
        "text": "ä", "none": None, "yes": True, "int": -(2**40), "float": 0.1, "list": [1, [2]],
        "pair": (1, 2), "triple": (1, 2, 3), "four": (1, 2, 3, 4), "empty": [[], {}, ()],
    }  # fmt: skip
    path = npz(tmp_path / "a.npz", pickle.dumps([value, value], protocol))
    expected = value | {"pair": [1, 2], "triple": [1, 2, 3], "four": [1, 2, 3, 4], "empty": [[], {}, []]}
    assert read_object_array(path, "annotations") == [expected, expected]


def test_what_numpy_stores(tmp_path: Path) -> None:
    values = [
        np.float32(0.5),
        np.uint16(7),
        np.int64(-3),
        np.bool_(True),
        np.arange(3.0),
        np.arange(4, dtype=">i2"),
    ]
    write_npz(tmp_path / "a.npz", [{"v": value} for value in values])
    assert [d["v"] for d in read_object_array(tmp_path / "a.npz", "annotations")] == [
        0.5, 7, -3, True, [0.0, 1.0, 2.0], [0, 1, 2, 3],
    ]  # fmt: skip
    write_npz(tmp_path / "empty.npz", [])
    assert read_object_array(tmp_path / "empty.npz", "annotations") == []


class _Runs:
    def __reduce__(self) -> Any:
        return os.mkdir, (str(_Runs.target),)

    target = Path()


class _Evaluates:
    def __reduce__(self) -> Any:
        return eval, ("__import__('os').mkdir('x')",)


@pytest.mark.parametrize("protocol", [0, 1, 2, 3, 4, 5])
@pytest.mark.parametrize("evil", [_Runs, _Evaluates])
def test_a_pickle_is_never_run(tmp_path: Path, protocol: int, evil: type[Any]) -> None:
    _Runs.target = tmp_path / "made"
    path = npz(tmp_path / "a.npz", pickle.dumps([evil()], protocol))
    with pytest.raises(InputError, match=r"a\.npz: is not an annotation file"):
        read_object_array(path, "annotations")
    assert not _Runs.target.exists()
    # NumPy itself would have run it.
    if evil is _Runs and protocol >= 2:
        with np.load(path, allow_pickle=True) as archive:
            _ = archive["annotations"]
        assert _Runs.target.exists()


def test_hostile_pickles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    laughs: Any = "ha"
    for _ in range(19):
        laughs = [laughs] * 10
    deep: Any = []
    for _ in range(200):
        deep = [deep]
    objects = np.array([None])
    scalar = pickle.dumps(np.float64(1.0), 3).replace(b"f8", b"O8")
    for data in (
        pickle.dumps(laughs, 4),
        pickle.dumps(deep, 4),
        pickle.dumps({1: 2}, 4),
        pickle.dumps(np.dtype("f8"), 4),
        scalar,
        pickle.dumps(objects.dtype, 4),
        b"",
        b"\x80\x04.",
        b"\x80\x04h\x07.",
        b"\x80\x04]e.",
        b"\x80\x04}]s.",
        b"\x80\x04K\x01b.",
        b"\xff\xfe",
    ):
        with pytest.raises(InputError, match=r"a\.npz: is not an annotation file") as caught:
            read_object_array(npz(tmp_path / "a.npz", data), "annotations")
        assert "\n" not in str(caught.value)
    for content in (b"", b"no archive", b"PK\x03\x04"):
        (tmp_path / "b.npz").write_bytes(content)
        with pytest.raises(InputError, match=r"b\.npz"):
            read_object_array(tmp_path / "b.npz", "annotations")
    with pytest.raises(InputError, match="is not an annotation file"):
        read_object_array(npz(tmp_path / "a.npz", b"", b"\x93NUMPY\x01\x00\xff\xff{"), "annotations")
    monkeypatch.setattr(inert_pickle, "MAX_UNPACKED", 2**10)
    write_npz(tmp_path / "c.npz", [{"v": np.zeros(10_000)}])
    with pytest.raises(InputError, match="unpacks to more than"):
        read_object_array(tmp_path / "c.npz", "annotations")
