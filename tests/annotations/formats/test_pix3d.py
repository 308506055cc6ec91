"""Pix3D's folder as our reader of the data set, written to Pix3D's documentation, reads it."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.formats.pix3d import _frame, _model_stem
from cadpose.annotations.formats.registry import documents_from, export
from cadpose.annotations.formats.sources import Sources
from cadpose.datasets.labels import mask_in_photo, object_in_photo
from cadpose.datasets.pix3d import pix3d
from cadpose.errors import InputError
from cadpose.geometry.camera import Cameras
from cadpose.photos import read_photo
from tests.annotations.formats.made import Made
from tests.datasets.trees import camera_rotation


@pytest.fixture
def folder(made: Made, tmp_path: Path) -> Path:
    return made.export("pix3d", tmp_path / "set")


@pytest.mark.parametrize("at", [-7.3, 0.0, 0.2, 12.25, 49.9, 50.0, 61.77, 99.99, 130.1])
def test_the_principal_point_lies_in_the_middle(at: float) -> None:
    left, top, width, height = _frame((at, 50.0), (100, 100), "x")
    assert abs(left + at - width / 2) <= 0.25
    assert (top, height) == (0, 100)
    assert left >= 0 and left + 100 <= width


def test_a_point_far_outside_is_refused() -> None:
    with pytest.raises(InputError, match="too far outside the photo"):
        _frame((1e6, 1e6), (100, 100), "street.png")


def test_the_reader_of_the_data_set_agrees(made: Made, folder: Path) -> None:
    labels = list(pix3d(folder))
    parts = [(d, part) for d in made.documents for part in d.annotations]
    assert len(labels) == len(parts) == 4
    points = np.random.default_rng(2).uniform(-0.4, 0.4, (50, 3))
    for label, (document, part) in zip(labels, parts, strict=True):
        assert label.category == part.detection.category and label.box is not None
        assert label.focal_px is not None and label.t_cv is not None
        entry = json.loads((folder / "pix3d.json").read_text())[labels.index(label)]
        offset = np.array(entry["cadpose"]["offset"])
        photo, _ = object_in_photo(label)
        cameras = Cameras(
            R_cv_from_s=camera_rotation(label)[None],
            t_cv=np.array([label.t_cv]),
            focal_px=np.array([label.focal_px]),
            principal_px=np.array([label.principal_px]),
            width=photo.width,
            height=photo.height,
        )
        moved = cameras.project(points)[0] - offset - part.pose.pose().project(points)
        # Pix3D's principal point is the picture's middle: the nearest half pixel, for all points the same.
        assert np.abs(moved).max() <= 0.25 + 1e-9
        np.testing.assert_allclose(moved, moved[:1].repeat(len(points), 0), atol=1e-9)
        original = read_photo(made.folder / document.photo.name.removeprefix("../../"))
        left, top = offset
        shown = photo.rgb[top : top + original.height, left : left + original.width]
        np.testing.assert_array_equal(shown, original.rgb)
        if part.detection.mask is not None:
            mask = mask_in_photo(label, photo)
            assert mask is not None and mask.sum() == sum(part.detection.mask.counts[1::2])


def test_the_models_are_the_librarys(made: Made, folder: Path) -> None:
    label = next(iter(pix3d(folder)))
    assert label.cad_path is not None
    mesh = made.library.mesh(made.documents[0].annotations[0].cad.id)
    vertices = [line.split()[1:] for line in label.cad_path.read_text().splitlines() if line[0] == "v"]
    np.testing.assert_array_equal(np.array(vertices, np.float32), mesh.vertices)


def edited(folder: Path, edit: Any) -> Any:
    file = folder / "pix3d.json"
    told = json.loads(file.read_text())
    edit(told[0])
    file.write_text(json.dumps(told))
    return next(iter(documents_from("pix3d", folder))).annotations[0]


def test_what_was_changed_counts(made: Made, folder: Path) -> None:
    before = made.documents[0].annotations[0]
    path = folder / json.loads((folder / "pix3d.json").read_text())[0]["mask"]
    Image.fromarray(np.full_like(np.asarray(Image.open(path)), 255)).save(path)
    part = edited(folder, lambda e: e.update(focal_length=2 * e["focal_length"], category="van"))
    assert part.pose.focal_px == pytest.approx(2 * before.pose.focal_px)
    assert (part.pose.azimuth, part.pose.principal_px) == (
        pytest.approx(before.pose.azimuth), before.pose.principal_px,
    )  # fmt: skip
    assert part.detection.category == "van" and part.detection.mask.counts == [0, 80 * 120]


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda e: e.pop("cadpose"), "dataset convert pix3d"),
        (lambda e: e.update(mask="../../etc/passwd"), "does not lie in"),
        (lambda e: e.update(trans_mat=[1.0, 0.0, 2.0]), "off the optical axis"),
        (lambda e: e.update(focal_length="x"), "lacks"),
        (lambda e: e.update(img_size=[5, 5]), "outside its picture"),
        (lambda e: e["cadpose"].update(offset=[-1, 0]), "outside its picture"),
        (lambda e: e["cadpose"].update(offset=None), "lacks"),
        (lambda e: e.update(img_size=[0, -3]), "outside its picture"),
        (lambda e: e["cadpose"]["photo"].update(size=[10**6, 10**6]), "more than 100000000 pixels"),
        (lambda e: e["cadpose"]["photo"].update(size="x"), "photo's size"),
    ],
)
def test_mistakes(folder: Path, edit: Any, words: str) -> None:
    with pytest.raises(InputError, match=words):
        edited(folder, edit)


def test_numbers_beyond_all_bounds(folder: Path) -> None:
    file = folder / "pix3d.json"
    told = json.loads(file.read_text())
    edits: tuple[Callable[[Any], object], ...] = (
        lambda e: e["cadpose"].update(offset=[0.5e-9, 0]),
        lambda e: e.update(bbox=[0.5e-9, 1, 2, 3]),
        lambda e: e.update(trans_mat=[0.0, 0.0, 0.5e-9]),
        lambda e: e.update(focal_length=0.5e-9),
    )
    for edit in edits:
        entries = json.loads(json.dumps(told))
        edit(entries[0])
        # Python's JSON writes no 1e999, but reads it as infinity.
        file.write_text(json.dumps(entries).replace("5e-10", "1e999"))
        with pytest.raises(InputError, match=r"entry 1|pix3d\.json") as caught:
            list(documents_from("pix3d", folder))
        assert "\n" not in str(caught.value)


def test_the_photos_own_camera(made: Made, tmp_path: Path) -> None:
    document = made.documents[0]
    whole = document.annotations[0].pose_6dof
    assert whole is not None
    out = tmp_path / "set"
    export("pix3d", [document], out, Sources(made.library.path, made.folder, photo_camera=True))
    label = next(iter(pix3d(out)))
    # Its principal point is the photo's middle, so nothing is added to the photo.
    assert label.principal_px == (60.0, 40.0)
    assert label.focal_px == pytest.approx(150.0)
    assert label.t_cv == pytest.approx(whole.t_cv)
    np.testing.assert_allclose(camera_rotation(label), whole.R_cv_from_s, atol=1e-12)
    assert list(documents_from("pix3d", out)) == [document]


def test_two_models_of_one_name_do_not_meet(made: Made, tmp_path: Path) -> None:
    (annotation,) = made.documents[1].annotations
    paths = set()
    for key in ("a/b/car.obj", "c/b/car.obj", "../../b/car.obj"):
        name = _model_stem(annotation.cad.model_copy(update={"id": key}))
        assert "/" not in name and not name.startswith(".")
        paths.add(name)
    assert len(paths) == 3
