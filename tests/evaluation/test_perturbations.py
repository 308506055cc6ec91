from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from cadpose.datasets.labels import Label, object_in_photo
from cadpose.evaluation.perturbations import Perturbation, jittered, shrunk, turned, turned_box
from cadpose.geometry.angles import wrap180
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.photos import FILL
from cadpose.records import Photo, Rotation

sizes = st.floats(1.0, 500.0)


@pytest.fixture
def label(tmp_path: Path) -> Label:
    noise = np.random.default_rng(0).integers(0, 256, (80, 120, 3), np.uint8)
    Image.fromarray(noise).save(tmp_path / "a.png")
    return Label(tmp_path / "a.png", "car", Box(30, 20, 90, 60), azimuth=40.0, elevation=10.0, inplane=170.0)


@given(sizes, sizes, st.floats(-180.0, 180.0))
def test_a_turned_box_lies_between_that_of_the_ellipse_and_that_of_the_corners(
    width: float, height: float, degrees: float
) -> None:
    c, s = abs(np.cos(np.radians(degrees))), abs(np.sin(np.radians(degrees)))
    w, h = turned_box(width, height, degrees)
    slack = 1.0 + 1e-9
    assert np.hypot(width * c, height * s) <= w * slack and w <= (width * c + height * s) * slack
    assert np.hypot(width * s, height * c) <= h * slack and h <= (width * s + height * c) * slack
    assert turned_box(width, height, -degrees) == pytest.approx((w, h))
    assert turned_box(width, height, degrees + 90.0) == pytest.approx((h, w), rel=1e-6)
    assert turned_box(width, height, 0.0) == pytest.approx((width, height))


def test_turning_a_photo_turns_the_object_counter_clockwise() -> None:
    """A cross of points drawn with the in-plane rotation is the cross drawn without it, turned."""
    points = np.array([[0.3, 0.0, 0.0], [-0.3, 0.1, 0.0], [0.0, 0.35, 0.1], [0.0, -0.2, -0.3]])

    def drawn(inplane: float) -> FloatArray:
        R = Rotation(130.0, 20.0, inplane).to_matrix()
        cameras = Cameras.from_rotations(R, focal_px=200.0, principal_px=(0, 0), width=1, height=1)
        return np.asarray(cameras.project(points)[0])

    centre, turn = np.array([70.0, 60.0]), 25.0
    rgb = np.zeros((130, 150, 3), np.uint8)
    for x, y in drawn(0.0) + centre:
        rgb[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2] = 255
    seen, box = turned(Photo(rgb), Box(20.0, 20.0, 120.0, 100.0), turn)
    grey = seen.rgb[..., 0].astype(float)
    for x, y in drawn(turn) + np.array(box.centre):
        spot = grey[int(y) - 3 : int(y) + 4, int(x) - 3 : int(x) + 4]
        rows, columns = np.mgrid[int(y) - 3 : int(y) + 4, int(x) - 3 : int(x) + 4] + 0.5
        assert spot.max() > 150
        middle = np.array([(columns * spot).sum(), (rows * spot).sum()]) / spot.sum()
        assert middle == pytest.approx([x, y], abs=1.0)


def test_what_the_photo_does_not_show_is_blank_and_nothing_moves_without_a_turn() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (40, 60, 3), np.uint8)
    seen, box = turned(Photo(rgb, "a.png", "ab", 35.0), Box(0, 0, 60, 40), 0.0)
    assert (seen.name, seen.sha256, seen.focal_35mm) == ("a.png", "ab", 35.0)
    assert (box.width, box.height) == pytest.approx((60, 40))
    x, y = round(box.x0), round(box.y0)
    assert np.array_equal(seen.rgb[y : y + 40, x : x + 60], rgb)
    assert seen.rgb[0, 0].tolist() == [FILL] * 3
    # A quarter turn counter-clockwise, to the pixel.
    seen, box = turned(Photo(rgb), Box(0, 0, 60, 40), 90.0)
    x, y = round(box.x0), round(box.y0)
    assert np.array_equal(seen.rgb[y : y + 60, x : x + 40], np.rot90(rgb))


def test_large_photos_are_reduced_before_they_are_turned() -> None:
    rgb = np.zeros((3000, 4096, 3), np.uint8)
    rgb[:, 2048:] = 200
    seen, box = turned(Photo(rgb), Box(0, 0, 4096, 3000), 90.0)
    assert (box.width, box.height) == pytest.approx((1500, 2048), abs=1.0)
    assert seen.rgb.shape == (4096, 4096, 3)
    x, y = (round(v) for v in box.centre)
    # The right half is up now.
    assert seen.rgb[y - 500, x].tolist() == [200] * 3 and seen.rgb[y + 500, x].tolist() == [0] * 3


def test_labels_turn_with_their_photos(label: Label) -> None:
    perturbation = Perturbation(turn=20.0, seed=3)
    (told,) = perturbation.turned_labels([label])
    angle = perturbation.angle(label)
    assert 0.0 < abs(angle) <= 20.0
    assert told.rotation is not None and label.rotation is not None
    assert told.rotation.inplane == pytest.approx(float(wrap180(170.0 + angle)))
    assert (told.azimuth, told.elevation, told.box) == (label.azimuth, label.elevation, label.box)
    # The turned label draws the same numbers as the one that was read.
    assert perturbation.angle(told) == angle
    one, other = perturbation.object_in_photo(label), perturbation.object_in_photo(told)
    assert np.array_equal(one[0].rgb, other[0].rgb) and one[1] == other[1]
    flat = Label(label.photo, "car", azimuth=40.0)
    assert perturbation.turned_labels([flat]) == [flat]
    assert Perturbation().turned_labels([label]) == [label]


def test_draws_are_seeded_and_stay_in_range(label: Label) -> None:
    labels = [Label(label.photo, "car", Box(1, 1, 20 + i, 30)) for i in range(300)]
    angles = [Perturbation(turn=30.0).angle(each) for each in labels]
    assert angles == [Perturbation(turn=30.0, jitter=0.1).angle(each) for each in labels]
    assert angles != [Perturbation(turn=30.0, seed=1).angle(each) for each in labels]
    assert max(np.abs(angles)) <= 30.0
    # Evenly distributed: mean 0, a standard deviation of 30 / sqrt(3).
    assert np.mean(angles) == pytest.approx(0.0, abs=3.0)
    assert np.std(angles) == pytest.approx(30.0 / np.sqrt(3.0), rel=0.1)
    boxes = [Perturbation(jitter=0.1, seed=s).object_in_photo(label)[1] for s in range(40)]
    moved = np.array([b.to_tuple() for b in boxes]) - [30, 20, 90, 60]
    assert np.abs(moved[:, [0, 2]]).max() <= 6.0 and np.abs(moved[:, [1, 3]]).max() <= 4.0
    assert (moved.std(axis=0) > [2.0, 1.5, 2.0, 1.5]).all()
    # Sides move on their own.
    assert np.abs(np.corrcoef(moved.T) - np.eye(4)).max() < 0.6
    assert boxes[7] == Perturbation(jitter=0.1, seed=7).object_in_photo(label)[1]


def test_words() -> None:
    assert Perturbation().in_words() == ""
    assert Perturbation(shrink=64).in_words() == "boxes shrunk to 64 px"
    assert Perturbation(0.1, None, 15.0, 2).in_words() == (
        "photos turned by up to 15°, boxes' sides moved by up to 10%, seed 2"
    )


def test_nothing_asked_changes_nothing(label: Label) -> None:
    photo, box = Perturbation().object_in_photo(label)
    plain, plain_box = object_in_photo(label)
    assert np.array_equal(photo.rgb, plain.rgb) and box == plain_box


def test_a_jittered_box_stays_in_the_photo_as_a_detectors_does() -> None:
    photo = Photo(np.zeros((80, 120, 3), np.uint8))
    box = jittered(Box(0, 0, 120, 80), np.array([-0.1, 0.1, -0.1, 0.1]), photo)
    assert box == Box(0, 8, 108, 80)


def test_shrinking_takes_detail_and_keeps_size_and_means() -> None:
    x = np.mgrid[:96, :96][1]
    stripes = np.where(x // 2 % 2 == 0, 0, 200).astype(np.uint8)
    halves = np.where(x < 48, 40, 160).astype(np.uint8)
    photo = Photo(np.dstack([stripes, halves, halves]))
    small = shrunk(photo, Box(0, 0, 96, 48), 24)
    assert small.rgb.shape == photo.rgb.shape
    # Stripes two pixels wide are gone at a quarter, halves are not.
    assert small.rgb[..., 0].std() < 5.0 and small.rgb[..., 0].mean() == pytest.approx(100.0, abs=2.0)
    assert np.abs(small.rgb[:, :40, 1].astype(int) - 40).max() <= 4
    # It is the box that counts, and there is nothing to take from a smaller one.
    assert shrunk(photo, Box(0, 0, 24, 10), 24) is photo
    assert shrunk(photo, Box(0, 0, 96, 96), 1).rgb.std() < 60.0


@pytest.mark.parametrize(
    "wrong",
    [
        {"jitter": -0.1},
        {"jitter": 0.5},
        {"shrink": 0},
        {"turn": -1.0},
        {"turn": 181.0},
        {"jitter": float("nan")},
    ],
)
def test_what_makes_no_sense_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        Perturbation(**wrong)  # type: ignore[arg-type]
