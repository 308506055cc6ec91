from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.intrinsics import Intrinsics
from cadpose.poses import PhotoCamera
from cadpose.records import Photo

PHOTO = Photo(np.zeros((60, 90, 3), np.uint8), "shots/street.jpg", focal_35mm=35.0)
PLAIN = Photo(np.zeros((60, 90, 3), np.uint8), "shots/plain.jpg")


def test_the_name_tells_apart_what_is_told(tmp_path: Path) -> None:
    texts = ["off", "exif", "100", "101", "100,1,2"]
    assert len({Intrinsics.from_text(text).name for text in texts}) == len(texts)
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"street.jpg": {"focal_px": 100}}))
    named = Intrinsics.from_text(str(path)).name
    assert named == Intrinsics.from_text(str(path)).name
    path.write_text(json.dumps({"street.jpg": {"focal_px": 101}}))
    assert named != Intrinsics.from_text(str(path)).name


def test_exif_tells_unless_it_is_off() -> None:
    assert Intrinsics().camera_of(PHOTO) == PhotoCamera.from_35mm(35.0, 90, 60)
    assert Intrinsics.from_text("exif") == Intrinsics()
    assert Intrinsics().camera_of(PLAIN) is None
    assert Intrinsics.from_text("off").camera_of(PHOTO) is None


def test_what_the_user_says_comes_before_exif() -> None:
    assert Intrinsics.from_text("120").camera_of(PHOTO) == PhotoCamera(120.0, (45.0, 30.0))
    assert Intrinsics.from_text("120,40,31.5").camera_of(PLAIN) == PhotoCamera(120.0, (40.0, 31.5))


def test_a_file_tells_photo_by_photo(tmp_path: Path) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(json.dumps({"street.jpg": {"focal_px": 100, "principal_px": [44, 29]}}))
    told = Intrinsics.from_text(str(path))
    assert told.camera_of(PHOTO) == PhotoCamera(100.0, (44.0, 29.0))
    assert told.camera_of(PLAIN) is None
    path.write_text(json.dumps({"shots/street.jpg": {"focal_px": 1}, "*": {"focal_px": 2.5}}))
    told = Intrinsics.from_text(str(path))
    assert told.camera_of(PHOTO) == PhotoCamera(1.0, (45.0, 30.0))
    assert told.camera_of(PLAIN) == PhotoCamera(2.5, (45.0, 30.0))


@pytest.mark.parametrize(
    "text", ["", "wide", "1,2", "1,2,3,4", "0", "-5", "nan", "inf", "100,nan,3", "1e400"]
)
def test_nonsense_is_refused_with_what_may_be_written(text: str) -> None:
    with pytest.raises(InputError, match=r"camera"):
        Intrinsics.from_text(text)


@pytest.mark.parametrize(
    "content",
    [
        "[1]",
        "{",
        "[" * 100_000,
        '{"a": 5}',
        '{"a": {}}',
        '{"a": {"focal_px": "5"}}',
        '{"a": {"focal_px": true}}',
        '{"a": {"focal_px": 0}}',
        '{"a": {"focal_px": 1' + "0" * 400 + "}}",
        '{"a": {"focal_px": 5, "principal_px": [1' + "0" * 400 + ", 1]}}",
        '{"a": {"focal_px": NaN}}',
        '{"a": {"focal_px": 5, "principal_px": [1]}}',
        '{"a": {"focal_px": 5, "principal_px": [1, "x"]}}',
        '{"a": {"focal_px": 5, "distortion": 1}}',
    ],
)
def test_a_bad_file_is_named(tmp_path: Path, content: str) -> None:
    path = tmp_path / "cameras.json"
    path.write_text(content)
    with pytest.raises(InputError, match=r"cameras\.json"):
        Intrinsics.from_text(str(path))


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        Intrinsics.from_text(str(tmp_path / "none.json"))
