from __future__ import annotations

import json
import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.datasets import files as files_module
from cadpose.datasets.gallery import read_gallery
from cadpose.datasets.labels import Label, object_in_photo, read_labels
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Rotation

GOOD: dict[str, Any] = {"photo": "a.png", "category": "car"}


def write(folder: Path, content: object) -> Path:
    path = folder / "labels.json"
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def test_every_field_is_read(tmp_path: Path) -> None:
    entry = GOOD | {
        "box": [1, 2.5, 30, 40],
        "cad": "x/y.obj",
        "azimuth": 370,
        "elevation": -3.5,
        "inplane": 2,
        "make": "ignored",
    }
    (label,) = read_labels(write(tmp_path, [entry]))
    assert label == Label(tmp_path / "a.png", "car", Box(1.0, 2.5, 30.0, 40.0), "x/y.obj", 370.0, -3.5, 2.0)
    assert label.rotation == Rotation(10.0, -3.5, 2.0)


def test_what_is_not_known_may_be_missing_or_null(tmp_path: Path) -> None:
    nulls = dict.fromkeys(("box", "cad", "azimuth", "elevation", "inplane"))
    bare, null = read_labels(write(tmp_path, [GOOD, GOOD | nulls]))
    assert bare == null == Label(tmp_path / "a.png", "car")
    assert bare.rotation is None


def test_a_drawn_photo_says_so(tmp_path: Path) -> None:
    told: list[dict[str, object]] = [
        {},
        {"synthetic": True},
        {"source": "synth"},
        {"source": "mine", "synthetic": False},
    ]
    labels = read_labels(write(tmp_path, [GOOD | more for more in told]))
    assert [label.synthetic for label in labels] == [False, True, True, False]
    with pytest.raises(InputError, match="synthetic must be true or false"):
        read_labels(write(tmp_path, [GOOD | {"synthetic": "no"}]))


def test_the_rotation_needs_azimuth_and_elevation(tmp_path: Path) -> None:
    path = write(
        tmp_path,
        [
            GOOD | {"azimuth": 10},
            GOOD | {"elevation": 5},
            GOOD | {"azimuth": 10, "inplane": 3},
            GOOD | {"azimuth": 10, "elevation": 5},
        ],
    )
    assert [label.rotation for label in read_labels(path)] == [None, None, None, Rotation(10.0, 5.0)]


def test_one_category_may_be_chosen(tmp_path: Path) -> None:
    path = write(tmp_path, [GOOD, GOOD | {"category": "chair"}, GOOD | {"photo": "b.png"}])
    assert [label.photo.name for label in read_labels(path, "car")] == ["a.png", "b.png"]
    assert len(read_labels(path)) == 3
    with pytest.raises(InputError, match=r"labels\.json: no label of category 'boat'; it has car, chair"):
        read_labels(path, "boat")


def test_words_for_a_category_mean_it(tmp_path: Path) -> None:
    words = ("motorcycle", "motorbike", "Motorcycles", "gizmo")
    path = write(tmp_path, [GOOD | {"category": word} for word in words])
    assert [label.category for label in read_labels(path)] == [*["motorbike"] * 3, "gizmo"]
    for word in ("motorcycle", "motorbike"):
        assert len(read_labels(path, word)) == 3
    assert len(read_labels(path, "gizmo")) == 1


@pytest.mark.parametrize(
    ("entry", "told"),
    [
        ("a.png", "has no photo"),
        ({"category": "car"}, "has no photo"),
        (GOOD | {"photo": 5}, "has no photo"),
        (GOOD | {"photo": ""}, "has no photo"),
        ({"photo": "a.png"}, "has no category"),
        (GOOD | {"category": ["car"]}, "has no category"),
        (GOOD | {"cad": 7}, "cad must be a library id"),
        (GOOD | {"azimuth": "90"}, "azimuth must be a number of degrees"),
        (GOOD | {"azimuth": True}, "azimuth must be a number of degrees"),
        (GOOD | {"azimuth": float("nan")}, "azimuth must be a number of degrees"),
        (GOOD | {"elevation": float("inf")}, "elevation must be a number of degrees"),
        (GOOD | {"inplane": 10**400}, "inplane must be a number of degrees"),
        (GOOD | {"azimuth": 0, "elevation": 91}, "elevation 91.0 is outside"),
        (GOOD | {"box": [0, 0, 10]}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": [0, 0, 10, 10, 1]}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": "0123"}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": {"x0": 0}}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": 4}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": [0, 0, "10", 10]}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": [0, 0, float("nan"), 10]}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": [0, 0, 10**400, 10]}, "box must be [x0, y0, x1, y1]"),
        (GOOD | {"box": [10, 0, 5, 10]}, "is empty: expected x0 < x1"),
    ],
)
def test_a_wrong_entry_is_told_with_file_and_number(tmp_path: Path, entry: object, told: str) -> None:
    path = write(tmp_path, [GOOD, entry])
    with pytest.raises(InputError, match=re.escape(told)) as caught:
        read_labels(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: entry 1")
    assert "\n" not in message
    assert len(message) < len(str(path)) + 120


@pytest.mark.parametrize(
    ("content", "told"),
    [
        ({"photo": "a.png"}, "expected a JSON array of labels, found dict"),
        ("[", "is not valid JSON"),
        ("", "is not valid JSON"),
        ("[" * 100_000, "is not valid JSON"),
        ('[{"azimuth": ' + "1" * 5000 + "}]", "is not valid JSON"),
        ([], "holds no label"),
    ],
    ids=["object", "cut", "empty", "deep", "digits", "none"],
)
def test_a_file_that_is_no_label_file(tmp_path: Path, content: object, told: str) -> None:
    path = write(tmp_path, content)
    for category in (None, "car"):
        with pytest.raises(InputError, match=f"^{re.escape(str(path))}.*{told}"):
            read_labels(path, category)


def test_a_file_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for path in (tmp_path / "none.json", tmp_path):
        with pytest.raises(InputError, match=f"^{re.escape(str(path))}: cannot be read"):
            read_labels(path)
    binary = tmp_path / "photo.json"
    binary.write_bytes(b"\xff\xd8\xff\xe0 no text")
    with pytest.raises(InputError, match="is not valid JSON"):
        read_labels(binary)
    monkeypatch.setattr(files_module, "MAX_BYTES", 10)
    with pytest.raises(InputError, match=r"labels\.json: larger than"):
        read_labels(write(tmp_path, [GOOD]))


@pytest.mark.skipif(os.name != "posix", reason="device files and pipes are a POSIX thing")
def test_neither_devices_nor_pipes_are_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zeros.json").symlink_to("/dev/zero")
    for path in (Path("/dev/zero"), tmp_path / "pipe", tmp_path / "zeros.json"):
        for read in (read_labels, read_gallery):
            with pytest.raises(InputError, match=f"^{re.escape(str(path))}: cannot be read .not a reg"):
                read(path)


# -- the object in its photo ----------------------------------------------------------------------


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    Image.fromarray(np.zeros((20, 30, 3), np.uint8)).save(tmp_path / "a.png")
    return tmp_path / "a.png"


@pytest.mark.parametrize(
    ("box", "expected"),
    [
        (None, Box(0, 0, 30, 20)),
        (Box(2, 3, 10, 12), Box(2, 3, 10, 12)),
        (Box(-5, 3, 300, 12), Box(0, 3, 30, 12)),
    ],
)
def test_the_box_lies_within_the_photo(picture: Path, box: Box | None, expected: Box) -> None:
    photo, found = object_in_photo(Label(picture, "car", box))
    assert (photo.width, photo.height, photo.name) == (30, 20, str(picture))
    assert found == expected


def test_a_box_beside_the_photo_is_an_error(picture: Path) -> None:
    with pytest.raises(InputError, match=r"a\.png: the labelled box lies outside the photo"):
        object_in_photo(Label(picture, "car", Box(30, 0, 40, 10)))


@pytest.mark.parametrize("name", ["none.png", "a\0.png"])
def test_a_photo_that_is_not_there(picture: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"\.png"):
        object_in_photo(Label(picture.parent / name, "car"))
