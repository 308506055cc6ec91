from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from cadpose.annotations.boxes import draw_detections, label_words
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
        for x, y in ((x0, y1 - 60), (x1, y1 - 60), (x0 + 90, y1), (x1, y0 + 60)):
            near = picture[y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3).astype(int)
            assert (abs(near - colour) < 90).all(axis=1).any(), "a thin line within a pixel or two"
        assert (picture[y0 + 40 : y1 - 5, x0 + 5 : x1 - 5] == GREY).all(), "the object itself stays visible"
        assert (picture[y0 + 40 : y1 - 30, x0 - 8 : x0 - 3] == GREY).all()
        # The name stands on a plate of the same colour above the box, in black or white.
        plate = picture[y0 - 16 : y0 - 3, x0 + 4 : x0 + 60].reshape(-1, 3)
        ink = 0 if 0.299 * colour[0] + 0.587 * colour[1] + 0.114 * colour[2] > 120 else 255
        assert (plate == colour).all(axis=1).mean() > 0.3 and (plate == ink).all(axis=1).any()


def test_a_mask_is_tinted_and_outlined_and_nothing_else_is() -> None:
    mask = np.zeros((600, 960), np.bool_)
    mask[220:480, 120:280] = True
    found = [Detection(Box(100, 200, 300, 500), "car", 0.9, mask)]
    picture = np.asarray(draw_detections(grey_photo(960, 600), found)).astype(int)
    inside, colour = picture[300:400, 150:250].reshape(-1, 3), np.array(colour_of(0))
    share = (inside - GREY)[:, colour != GREY] / (colour - GREY)[colour != GREY]
    assert (inside == inside[0]).all() and share == pytest.approx(0.38, abs=0.02)
    rim = picture[340, 116:125]
    assert (abs(rim - colour) < 40).all(axis=1).any(), "the outline is stronger than the tint"
    assert (picture[240:470, 105:114] == GREY).all() and (picture[486:495, 140:260] == GREY).all()


def test_small_objects_lie_over_large_ones() -> None:
    whole, part = np.ones((600, 960), np.bool_), np.zeros((600, 960), np.bool_)
    part[200:400, 400:600] = True
    small = Detection(Box(400, 200, 600, 400), "cup", 0.9, part)
    large = Detection(Box(0, 0, 960, 600), "table", 0.8, whole)
    one, other = (draw_detections(grey_photo(960, 600), found) for found in ([small, large], [large, small]))
    # Numbers, and so colours, go with the order; what lies over what does not.
    for image, number in ((one, 0), (other, 1)):
        inner, colour = np.asarray(image)[300, 500].astype(float), np.array(colour_of(number), float)
        under = 0.62 * GREY + 0.38 * np.array(colour_of(1 - number), float)
        np.testing.assert_allclose(inner, 0.62 * under + 0.38 * colour, atol=2)


def test_labels_tell_what_is_doubtful() -> None:
    others = (("sofa", 0.2), ("bed", 0.1), ("bench", 0.05))
    plain = Detection(Box(1, 1, 9, 9), "chair", 0.834, alternatives=others)
    assert label_words(0, plain) == "1 chair 0.83"
    doubtful = dataclasses.replace(plain, unsure=True, truncated=True, tiny=True)
    assert label_words(1, doubtful) == "2 unsure: chair / sofa / bed 0.83 · truncated · tiny"


def test_a_name_at_the_upper_border_goes_into_the_box() -> None:
    picture = np.asarray(draw_detections(grey_photo(960, 600), [Detection(Box(10, 0, 400, 300), "car", 0.9)]))
    plate = picture[3:15, 16:60].reshape(-1, 3)
    assert (plate == colour_of(0)).all(axis=1).mean() > 0.3


@pytest.mark.parametrize("category", ["a" * 4000, "zwölf 椅子 \x00\n", "\ud800"])
def test_any_name_can_be_drawn_within_the_picture(category: str) -> None:
    photo = grey_photo(300, 200)
    for box in (Box(0, 0, 300, 200), Box(299.5, 199.5, 300, 200), Box(-50, -50, 400, 1000)):
        draw_detections(photo, [Detection(box, category, 0.5)])


def test_a_name_near_the_right_border_stays_within_the_picture() -> None:
    found = [Detection(Box(930, 200, 955, 300), "wardrobe", 0.5)]
    picture = np.asarray(draw_detections(grey_photo(960, 600), found))
    plate = (picture[186:192] == colour_of(0)).all(axis=2).any(axis=0)
    assert np.flatnonzero(plate)[0] < 880, "moved to the left, so that the whole name is there"
