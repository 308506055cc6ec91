from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.annotations.overlay import MAX_SIDE, MIN_SIDE, draw_overlay, overlay_cameras, overlay_size
from cadpose.annotations.style import COLOURS, angles_text, colour_of, label_text, short
from cadpose.geometry.boxes import Box
from cadpose.records import Annotation, Candidate, Detection, Photo, Pose4Dof, Rotation, Views
from tests.annotations.factory import make_annotation, make_cad, make_photo, make_views


def grey(width: int, height: int) -> Photo:
    return Photo(np.full((height, width, 3), 128, np.uint8), "grey.jpg", "ab" * 32)


def empty(width: int, height: int) -> Views:
    alpha = np.zeros((1, height, width), np.uint8)
    return Views(np.zeros((1, height, width, 3), np.uint8), alpha, np.full(alpha.shape, np.inf, np.float32))


def filled(width: int, height: int, box: tuple[int, int, int, int]) -> Views:
    views = empty(width, height)
    x0, y0, x1, y1 = box
    views.alpha[0, y0:y1, x0:x1] = 255
    views.rgb[0, y0:y1, x0:x1] = (250, 0, 0)
    return views


def near(pixels: NDArray[np.uint8], colour: tuple[int, int, int], tolerance: int = 40) -> NDArray[np.bool_]:
    return np.asarray(np.abs(pixels.astype(int) - colour).max(axis=-1) <= tolerance)


@pytest.mark.parametrize(
    ("size", "expected"),
    [((120, 80), (960, 640)), ((1000, 500), (1000, 500)), ((500, 4000), (200, 1600)), ((9000, 1), (1600, 1))],
)
def test_overlay_size_keeps_the_aspect_within_limits(
    size: tuple[int, int], expected: tuple[int, int]
) -> None:
    assert overlay_size(*size) == expected
    assert MIN_SIDE <= max(expected) <= MAX_SIDE


def test_overlay_cameras_project_as_the_pose_does_but_for_scale() -> None:
    annotation = make_annotation(make_photo())
    cameras = overlay_cameras(annotation)
    assert (cameras.width, cameras.height) == (960, 640)
    points = np.random.default_rng(0).uniform(-0.5, 0.5, (9, 3))
    assert cameras.project(points)[0] == pytest.approx(annotation.pose.project(points) * 8.0, abs=1e-6)


def test_without_objects_the_photo_is_left_alone() -> None:
    photo = grey(1000, 600)
    assert np.array_equal(np.asarray(draw_overlay(photo, [])), photo.rgb)


def test_the_model_is_blended_and_outlined_where_it_is() -> None:
    photo = grey(1200, 800)
    annotation = make_annotation(photo, box=Box(300, 200, 900, 700))
    picture = np.asarray(draw_overlay(photo, [(annotation, filled(1200, 800, (400, 300, 800, 600)))]))
    assert picture.shape == (800, 1200, 3)
    # Neither photo nor render alone.
    inside = picture[580, 420].astype(int)
    assert 160 < inside[0] < 245
    assert 20 < inside[1] < 100
    for y, x in ((300, 500), (600, 500), (450, 400), (450, 800)):
        assert near(picture[y - 1 : y + 1, x - 1 : x + 1], COLOURS[0]).any(), (y, x)
    # Far from the box, its label and the axes the photo is untouched.
    assert (picture[720:] == 128).all()
    assert (picture[:, :290] == 128).all()


def test_the_box_is_drawn_where_the_detection_is() -> None:
    photo = grey(1200, 800)
    annotation = make_annotation(photo, box=Box(300, 200, 900, 700))
    picture = np.asarray(draw_overlay(photo, [(annotation, empty(1200, 800))]))
    for y, x in ((450, 300), (450, 900), (700, 600)):
        assert near(picture[y - 1 : y + 1, x - 1 : x + 1], COLOURS[0], 70).any(), (y, x)


@pytest.mark.parametrize(
    ("rotation", "side"),
    # The front points to image left at azimuth 90 and to image right at 270 (docs/conventions.md).
    [(Rotation(90.0, 0.0), -1), (Rotation(270.0, 0.0), 1)],
)
def test_the_front_axis_points_where_the_front_is(rotation: Rotation, side: int) -> None:
    photo = grey(1200, 800)
    box = Box(100, 100, 1100, 700)
    annotation = make_annotation(photo, box=box, pose=Pose4Dof(rotation, 1000.0, box.centre))
    picture = np.asarray(draw_overlay(photo, [(annotation, empty(1200, 800))]))
    blue = near(picture, (51, 154, 240), 30)
    assert blue.sum() > 300
    assert np.sign(np.flatnonzero(blue.any(axis=0)).mean() - 600) == side
    green = near(picture, (64, 192, 87), 30)
    assert np.flatnonzero(green.any(axis=1)).mean() < 400


def test_axes_are_shortened_to_stay_in_the_box() -> None:
    photo = grey(1000, 400)
    box = Box(0, 0, 1000, 400)
    annotation = make_annotation(photo, box=box, pose=Pose4Dof(Rotation(300.0, 10.0), 1500.0, box.centre))
    assert annotation.pose.project(np.array([[0.0, 0.21, 0.0]]))[0, 1] < 50  # else this proves nothing
    picture = np.asarray(draw_overlay(photo, [(annotation, empty(1000, 400))]))
    assert np.flatnonzero(near(picture, (64, 192, 87), 30).any(axis=1)).min() >= 24


def test_a_view_of_the_photos_size_is_scaled_with_it() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)
    small = np.asarray(draw_overlay(photo, [(annotation, filled(120, 80, (30, 20, 90, 60)))])).astype(int)
    large = np.asarray(draw_overlay(photo, [(annotation, filled(960, 640, (240, 160, 720, 480)))])).astype(
        int
    )
    assert small.shape == (640, 960, 3)
    assert np.abs(small - large).mean() < 2


def test_several_objects_have_their_own_colours_and_labels_that_do_not_overlap() -> None:
    photo = grey(1200, 800)
    boxes = [Box(500, 300, 700, 500), Box(505, 302, 690, 480), Box(510, 305, 680, 490)]
    items = [(make_annotation(photo, box=box), empty(1200, 800)) for box in boxes]
    picture = np.asarray(draw_overlay(photo, items))
    alone = np.asarray(draw_overlay(photo, items[:1]))
    label = int(near(alone, COLOURS[0], 4).sum())
    for colour in COLOURS[:3]:
        assert int(near(picture, colour, 4).sum()) > 0.85 * label
    assert len({colour_of(i) for i in range(8)}) == 8


@pytest.mark.parametrize("box", [Box(-50, -40, 20, 15), Box(0, 0, 1200, 800), Box(1195, 790, 1300, 900)])
def test_boxes_and_poses_beyond_the_border_are_drawn(box: Box) -> None:
    photo = grey(1200, 800)
    for rotation in (Rotation(0, 0), Rotation(0, 90), Rotation(0, -90), Rotation(180, 0, 170)):
        for focal in (1e-3, 1e12):
            pose = Pose4Dof(rotation, focal, box.centre)
            annotation = make_annotation(photo, box=box, pose=pose)
            assert draw_overlay(photo, [(annotation, empty(1200, 800))]).size == (1200, 800)


@pytest.mark.parametrize("size", [(1, 1), (1, 700), (5000, 2)])
def test_odd_photos_are_drawn(size: tuple[int, int]) -> None:
    width, height = size
    photo = grey(width, height)
    annotation = make_annotation(
        photo,
        detection=Detection(Box(0, 0, width, height), "car"),
        pose=Pose4Dof(Rotation(10, 5), 10.0, (0, 0)),
    )
    views = filled(width, height, (0, 0, width, height))
    assert draw_overlay(photo, [(annotation, views)]).size == overlay_size(width, height)


def test_a_view_that_does_not_fit_is_refused() -> None:
    photo = make_photo()
    annotation = make_annotation(photo)
    for views in (make_views(1, 64, 64), make_views(2, 120, 80)):
        with pytest.raises(ValueError, match="needs one view"):
            draw_overlay(photo, [(annotation, views)])


def named(name: str, category: str = "car") -> Annotation:
    photo = make_photo()
    annotation = make_annotation(photo)
    return dataclasses.replace(
        annotation,
        detection=dataclasses.replace(annotation.detection, category=category),
        candidates=(Candidate(make_cad(name=name), 1.0, Rotation(0, 0)),),
    )


def test_label() -> None:
    words = "car · Seat Leon · az 312° el 8° ip -2° · f 161 px"
    annotation = named("Seat Leon")
    assert label_text(annotation) == f"{words} · truncated · unsure"
    plain = dataclasses.replace(annotation.detection, truncated=False, unsure=False)
    assert label_text(dataclasses.replace(annotation, detection=plain)) == words
    assert angles_text(Pose4Dof(Rotation(359.8, -0.2, 0.4), 1.0, (0, 0))) == "az 0° el 0° ip 0°"
    assert short("a\nb\x1b[31m\u202ec", 40) == "a b [31m c"
    assert short("x" * 99, 10) == "x" * 9 + "…"
    assert len(label_text(named("x" * 10_000, "y" * 10_000))) < 140


def test_hostile_names_are_drawn() -> None:
    photo = make_photo()
    for name in ("", "\n\n", "漢字 🚗", "x" * 10_000, "\udce9"):
        assert draw_overlay(photo, [(named(name), empty(120, 80))]).size == (960, 640)
