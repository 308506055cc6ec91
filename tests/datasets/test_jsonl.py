"""Label files in JSONL: what is written is what is read, and nothing else is believed."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from cadpose import rle
from cadpose.datasets import files as files_module
from cadpose.datasets.labels import (
    Label,
    RunLengths,
    iter_labels,
    mask_in_photo,
    object_in_photo,
    only_unoccluded,
    read_labels,
    write_labels,
)
from cadpose.datasets.viewpoints import as_matrix
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.class_map import CATEGORIES
from cadpose.records import Rotation

GOOD: dict[str, Any] = {"photo": "a.png", "category": "car"}

names = st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), min_size=1, max_size=12)
file_names = names.filter(lambda name: name not in (".", ".."))
numbers = st.floats(-1e6, 1e6)
pairs = st.tuples(numbers, numbers)
words = st.none() | names
masks = file_names.map(lambda name: Path("masks", name))


@st.composite
def labels(draw: st.DrawFn) -> Label:
    x, y = draw(pairs)
    has_camera = draw(st.booleans())
    counts = st.lists(st.integers(0, 2**40), max_size=5).map(tuple) | st.text(max_size=5)
    sizes = st.tuples(st.integers(0, 2**20), st.integers(0, 2**20))
    rotations = st.builds(Rotation, numbers, st.floats(-90, 90), numbers)
    return Label(
        photo=Path("folder", draw(file_names)),
        category=draw(st.sampled_from(sorted(CATEGORIES)) | st.just("gizmo")),
        box=draw(st.none() | st.just(Box(x, y, x + draw(st.floats(1, 1e3)), y + draw(st.floats(1, 1e3))))),
        cad=draw(words),
        azimuth=draw(st.none() | numbers),
        elevation=draw(st.none() | st.floats(-90, 90)),
        inplane=draw(st.none() | numbers),
        mask=draw(
            st.none() | file_names.map(lambda n: Path("masks", n)) | st.builds(RunLengths, sizes, counts)
        ),
        focal_px=draw(st.floats(1e-3, 1e6)) if has_camera else None,
        principal_px=draw(pairs) if has_camera else None,
        R_cv_from_s=draw(st.none() | rotations.map(as_matrix)),
        t_cv=draw(st.none() | st.tuples(numbers, numbers, numbers)),
        split=draw(words),
        truncated=draw(st.booleans()),
        occluded=draw(st.booleans()),
        difficult=draw(st.booleans()),
        source=draw(words),
    )


@given(st.lists(labels(), min_size=1, max_size=4))
@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
def test_what_is_written_is_what_is_read(tmp_path: Path, made: list[Label]) -> None:
    def placed(label: Label) -> Label:
        mask = tmp_path / label.mask if isinstance(label.mask, Path) else label.mask
        return replace(label, photo=tmp_path / label.photo, mask=mask)

    wanted = [placed(label) for label in made]
    path = tmp_path / "labels.jsonl"
    assert write_labels(path, iter(wanted)) == len(wanted)
    assert read_labels(path) == wanted == list(iter_labels(path))
    assert len(path.read_text("ascii").splitlines()) == len(wanted)


def write(folder: Path, *lines: object) -> Path:
    path = folder / "labels.jsonl"
    text = [line if isinstance(line, str) else json.dumps(line) for line in lines]
    path.write_text("\n".join(text), encoding="utf-8")
    return path


def test_paths_are_relative_to_the_label_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photo = tmp_path / "data" / "car" / "a.png"
    photo.parent.mkdir(parents=True)
    photo.touch()
    (tmp_path / "link").symlink_to(tmp_path / "data" / "car", target_is_directory=True)
    monkeypatch.chdir(tmp_path)
    for given_photo in (photo, Path("data/car/a.png"), Path("data/../data/car/a.png"), Path("link/a.png")):
        for out in (tmp_path / "out" / "l.jsonl", Path("out/l.jsonl"), Path("l.jsonl"), Path("link/l.jsonl")):
            write_labels(out, [Label(given_photo, "car")])
            entry = json.loads(out.read_text())
            assert not Path(entry["photo"]).is_absolute()
            (label,) = read_labels(out)
            assert label.photo.samefile(photo), (given_photo, out)


def test_labels_are_written_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "l.jsonl"
    write_labels(path, [Label(tmp_path / "a.png", "car")])
    before = path.read_bytes()

    def stops() -> Any:
        yield Label(tmp_path / "b.png", "car")
        raise InputError("no more")

    with pytest.raises(InputError, match="no more"):
        write_labels(path, stops())
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["l.jsonl"]
    with pytest.raises(InputError, match=r"l\.json: labels are written as JSONL"):
        write_labels(tmp_path / "l.json", [])


def test_splits_and_categories(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD | {"split": "train"}, "", GOOD | {"split": "val"}, GOOD | {"category": "bus"})
    assert [label.split for label in read_labels(path)] == ["train", "val", None]
    assert len(read_labels(path, split="val")) == 1
    with pytest.raises(InputError, match=r"labels\.jsonl: no label of split 'test'; it has none, train, val"):
        read_labels(path, split="test")
    with pytest.raises(InputError, match="no label of split 'val'; it has none"):
        read_labels(path, "bus", "val")
    with pytest.raises(InputError, match="no label of category 'boat'; it has bus, car"):
        read_labels(path, "boat", "val")


def test_flags(tmp_path: Path) -> None:
    flags = ("truncated", "occluded", "difficult")
    path = write(tmp_path, GOOD, *(GOOD | {flag: True} for flag in flags), GOOD | dict.fromkeys(flags))
    read = read_labels(path)
    assert [(one.truncated, one.occluded, one.difficult) for one in read] == [
        (False, False, False), (True, False, False), (False, True, False), (False, False, True),
        (False, False, False),
    ]  # fmt: skip
    assert only_unoccluded(read, path) == [read[0], read[3], read[4]]
    with pytest.raises(InputError, match=r"labels\.jsonl: every label is occluded or truncated"):
        only_unoccluded(read[1:3], path)


K: list[list[Any]] = [[100, 0, 10], [0, 100.5, 20], [0, 0, 1]]


def test_a_camera(tmp_path: Path) -> None:
    (label,) = read_labels(write(tmp_path, GOOD | {"K": K}))
    assert (label.focal_px, label.principal_px) == (100.25, (10.0, 20.0))
    np.testing.assert_array_equal(label.K, [[100.25, 0, 10], [0, 100.25, 20], [0, 0, 1]])


def changed(row: int, column: int, value: object) -> list[list[Any]]:
    made = [list(r) for r in K]
    made[row][column] = value
    return made


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"K": 5}, "K must be three rows of three numbers"),
        ({"K": K[:2]}, "K must be three rows of three numbers"),
        ({"K": changed(0, 0, "f")}, "K must be three rows of three numbers"),
        ({"K": changed(0, 1, 1)}, "K must be [[f, 0, x]"),
        ({"K": changed(2, 0, 1)}, "K must be [[f, 0, x]"),
        ({"K": changed(1, 1, 150)}, "only square pixels"),
        ({"K": [[-1, 0, 1], [0, -1, 1], [0, 0, 1]]}, "focal length -1.0 must be above 0"),
        ({"K": [[0, 0, 1], [0, 0, 1], [0, 0, 1]]}, "focal length 0.0 must be above 0"),
        ({"R": [[2, 0, 0], [0, 1, 0], [0, 0, 1]]}, "R is not a rotation matrix"),
        ({"R": [[-1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "R is not a rotation matrix"),
        ({"R": [[1e200, 0, 0], [0, 1e200, 0], [0, 0, 1]]}, "R is not a rotation matrix"),
        ({"R": [[1e200, 1e200, 0], [1e200, -1e200, 0], [0, 0, 1]]}, "R is not a rotation matrix"),
        ({"R": [1, 2, 3]}, "R must be three rows"),
        ({"t": [1, 2]}, "t must be [x, y, z]"),
        ({"t": [1, 2, float("nan")]}, "t must be [x, y, z]"),
        ({"mask": 5}, "mask must be a path or"),
        ({"mask": ""}, "mask must be a path or"),
        ({"mask": {"size": [2, 2]}}, "mask must be a path or"),
        ({"mask": {"size": [2], "counts": "a"}}, "mask must be a path or"),
        ({"mask": {"size": [2, -2], "counts": "a"}}, "mask must be a path or"),
        ({"mask": {"size": [2, 2], "counts": [1, "a"]}}, "mask must be a path or"),
        ({"mask": {"size": [2, 2], "counts": [True]}}, "mask must be a path or"),
        ({"split": 5}, "split must be a word"),
        ({"source": ""}, "source must be a word"),
        ({"occluded": "no"}, "occluded must be true or false"),
        ({"truncated": 1}, "truncated must be true or false"),
        ({"difficult": []}, "difficult must be true or false"),
        ({"photo": None}, "has no photo"),
        ({"elevation": 91, "azimuth": 0}, "elevation 91.0 is outside"),
    ],
)
def test_a_wrong_line_is_told_with_file_and_number(tmp_path: Path, changes: Any, told: str) -> None:
    path = write(tmp_path, GOOD, "", GOOD | changes)
    with pytest.raises(InputError, match=re.escape(told)) as caught:
        read_labels(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: line 3") and "\n" not in message


@pytest.mark.parametrize("line", ["{", "nonsense", '{"photo": "a" "b"}', "[" * 100_000, '"' + "\\ud8" + '"'])
def test_a_line_that_is_no_json(tmp_path: Path, line: str) -> None:
    path = write(tmp_path, GOOD, line)
    with pytest.raises(InputError, match=f"^{re.escape(str(path))}: line 2: is not valid JSON"):
        read_labels(path)


def test_a_file_without_labels(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="holds no label"):
        read_labels(write(tmp_path, "", ""))
    with pytest.raises(InputError, match="line 1 has no photo"):
        read_labels(write(tmp_path, [GOOD]))
    with pytest.raises(InputError, match="cannot be read"):
        read_labels(tmp_path / "none.jsonl")


def test_lines_and_files_have_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path, *[GOOD] * 100)
    monkeypatch.setattr(files_module, "MAX_LINE_BYTES", 30)
    with pytest.raises(InputError, match=r"labels\.jsonl: line 1 is longer than"):
        read_labels(path)
    monkeypatch.setattr(files_module, "MAX_LINE_BYTES", 300)
    monkeypatch.setattr(files_module, "MAX_JSONL_BYTES", 1000)
    with pytest.raises(InputError, match=r"labels\.jsonl: larger than"):
        read_labels(path)


def test_lines_are_read_as_they_are_asked_for(tmp_path: Path) -> None:
    path = write(tmp_path, GOOD, "nonsense")
    assert next(iter_labels(path)).category == "car"


# -- masks ----------------------------------------------------------------------------------------


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    Image.new("RGB", (30, 20)).save(tmp_path / "a.png")
    return tmp_path / "a.png"


def test_masks(picture: Path) -> None:
    mask = np.zeros((20, 30), np.bool_)
    mask[4:9, 3:20] = True
    painted = Image.fromarray(np.where(mask, np.uint8(255), np.uint8(0)))
    painted.save(picture.parent / "m.png")
    painted.convert("1").save(picture.parent / "one-bit.png")
    runs = RunLengths((20, 30), tuple(rle.encode_mask(mask)))
    for given_mask in (picture.parent / "m.png", picture.parent / "one-bit.png", runs):
        label = Label(picture, "car", mask=given_mask)
        photo, _ = object_in_photo(label)
        found = mask_in_photo(label, photo)
        assert found is not None
        np.testing.assert_array_equal(found, mask)
    assert mask_in_photo(Label(picture, "car"), photo) is None


@pytest.mark.parametrize(
    ("mask", "told"),
    [
        (RunLengths((20, 30), (5, 5)), "cannot be decoded"),
        (RunLengths((20, 30), "\x01"), "cannot be decoded"),
        (RunLengths((2**20, 2**20), (2**40,)), "above the limit"),
        (RunLengths((0, 30), ()), "cannot be decoded"),
        (RunLengths((4, 5), (0, 20)), "has 5 x 4 pixels, its photo 30 x 20"),
        (RunLengths((20, 30), (600,)), "covers no pixel"),
        (Path("a.png"), "a.png covers no pixel"),
        (Path("none.png"), "none.png"),
    ],
)
def test_masks_that_do_not_fit(picture: Path, mask: RunLengths | Path, told: str) -> None:
    given_mask = picture.parent / mask if isinstance(mask, Path) else mask
    label = Label(picture, "car", mask=given_mask)
    photo, _ = object_in_photo(label)
    with pytest.raises(InputError, match=told):
        mask_in_photo(label, photo)
