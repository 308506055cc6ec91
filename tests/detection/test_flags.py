from __future__ import annotations

import pytest

from cadpose.detection.flags import flagged
from cadpose.geometry.boxes import Box
from cadpose.records import Detection


@pytest.mark.parametrize(
    ("box", "truncated"),
    [
        ((50, 50, 200, 200), False),
        ((0, 50, 200, 200), True),
        ((9, 50, 200, 200), True),  # within 1 % of 1000 pixels
        ((11, 50, 200, 200), False),
        ((50, -20, 200, 200), True),
        ((50, 50, 1000, 200), True),
        ((50, 50, 200, 591), True),
        ((50, 50, 200, 589), False),
    ],
)
def test_a_box_at_the_edge_is_truncated(box: tuple[float, float, float, float], truncated: bool) -> None:
    found = flagged(Detection(Box(*box), "car"), 1000, 600)
    assert found.truncated == truncated and not found.tiny


@pytest.mark.parametrize(
    ("box", "tiny"),
    [
        ((50, 50, 82, 82), False),  # 1024 pixels
        ((50, 50, 82, 81), True),
        ((50, 50, 60, 160), False),
        ((980, 50, 1100, 60), True),  # only what lies in the photo counts
        ((2000, 50, 2100, 160), True),
    ],
)
def test_a_box_of_few_pixels_is_tiny(box: tuple[float, float, float, float], tiny: bool) -> None:
    assert flagged(Detection(Box(*box), "car"), 1000, 600).tiny == tiny


def test_flags_are_set_anew_and_the_detectors_own_is_left() -> None:
    found = flagged(Detection(Box(50, 50, 200, 200), "car", truncated=True, tiny=True, unsure=True), 640, 480)
    assert (found.truncated, found.tiny, found.unsure) == (False, False, True)


def test_a_detection_that_has_its_flags_stays_itself() -> None:
    found = Detection(Box(50, 50, 200, 200), "car")
    assert flagged(found, 640, 480) is found


def test_a_photo_of_a_few_pixels_has_an_edge_of_one_pixel() -> None:
    assert flagged(Detection(Box(1, 3, 5, 5), "car"), 20, 20).truncated
    assert not flagged(Detection(Box(2, 2, 5, 5), "car"), 20, 20).truncated
