from __future__ import annotations

import numpy as np
import pytest

from cadpose.annotations.boxes import draw_detections
from cadpose.annotations.overlay import overlay_size
from cadpose.annotations.style import colour_of
from cadpose.geometry.boxes import Box
from cadpose.records import Detection, Photo

GREY = 90


def grey_photo(width: int, height: int) -> Photo:
    return Photo(np.full((height, width, 3), GREY, np.uint8))


@pytest.mark.parametrize(("width", "height"), [(400, 300), (3000, 2000), (1, 1), (5, 700)])
def test_the_picture_has_the_overlays_size(width: int, height: int) -> None:
    photo = grey_photo(width, height)
    image = draw_detections(photo, [Detection(Box(0, 0, width, height), "car", 0.5)])
    assert image.mode == "RGB" and image.size == overlay_size(width, height)


def test_no_detection_leaves_the_photo_alone() -> None:
    picture = np.asarray(draw_detections(grey_photo(960, 600), []))
    assert (picture == GREY).all()


def test_boxes_lie_where_they_are_in_their_colours() -> None:
    # The overlay's size is the photo's, so pixels are the same.
    found = [Detection(Box(100, 200, 300, 500), "car", 0.9), Detection(Box(500, 100, 900, 400), "chair", 0.4)]
    picture = np.asarray(draw_detections(grey_photo(960, 600), found))
    for number, detection in enumerate(found):
        x0, y0, x1, y1 = (int(v) for v in detection.box.to_tuple())
        colour = colour_of(number)
        for x, y in ((x0, y1 - 20), (x1 - 1, y1 - 20), (x0 + 50, y1 - 1), (x1 - 1, y0 + 40)):
            assert tuple(picture[y, x]) == colour
        assert (picture[y0 + 40 : y1 - 5, x0 + 5 : x1 - 5] == GREY).all(), "the object itself stays visible"
        assert (picture[y0 + 40 : y1, x0 - 5 : x0 - 1] == GREY).all()
        # The name stands on a plate of the same colour above the box, in white.
        plate = picture[y0 - 16 : y0 - 1, x0 : x0 + 60].reshape(-1, 3)
        assert (plate == colour).all(axis=1).mean() > 0.3 and (plate == 255).all(axis=1).any()


def test_a_name_at_the_upper_border_goes_into_the_box() -> None:
    picture = np.asarray(draw_detections(grey_photo(960, 600), [Detection(Box(10, 0, 400, 300), "car", 0.9)]))
    plate = picture[3:15, 14:60].reshape(-1, 3)
    assert (plate == colour_of(0)).all(axis=1).mean() > 0.3


@pytest.mark.parametrize("category", ["a" * 4000, "zwölf 椅子 \x00\n", "\ud800"])
def test_any_name_can_be_drawn_within_the_picture(category: str) -> None:
    photo = grey_photo(300, 200)
    for box in (Box(0, 0, 300, 200), Box(299.5, 199.5, 300, 200), Box(-50, -50, 400, 1000)):
        draw_detections(photo, [Detection(box, category, 0.5)])


def test_a_name_near_the_right_border_stays_within_the_picture() -> None:
    found = [Detection(Box(930, 200, 955, 300), "wardrobe", 0.5)]
    picture = np.asarray(draw_detections(grey_photo(960, 600), found))
    plate = (picture[190:195] == colour_of(0)).all(axis=2).any(axis=0)
    assert np.flatnonzero(plate)[0] < 880, "moved to the left, so that the whole name is there"
