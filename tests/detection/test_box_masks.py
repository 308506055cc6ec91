from __future__ import annotations

import numpy as np
import pytest

from cadpose.detection.box_masks import BoxMasks
from cadpose.geometry.boxes import Box
from cadpose.records import Photo

PHOTO = Photo(np.zeros((40, 60, 3), np.uint8))


def test_the_box_and_nothing_else() -> None:
    mask = BoxMasks().mask(PHOTO, Box(10, 5, 30, 25))
    assert mask.shape == (40, 60) and mask.sum() == 400 and mask[5:25, 10:30].all()


def test_a_pixel_counts_by_its_centre() -> None:
    assert Box.from_mask(BoxMasks().mask(PHOTO, Box(10.4, 5.6, 12.6, 8.4))) == Box(10, 6, 13, 8)


@pytest.mark.parametrize("box", [Box(3.6, 3.6, 3.7, 3.7), Box(59.9, 39.9, 80, 80), Box(-9, -9, 0.1, 0.1)])
def test_never_empty(box: Box) -> None:
    assert BoxMasks().mask(PHOTO, box).sum() == 1


def test_a_box_outside_the_photo() -> None:
    with pytest.raises(ValueError, match="outside the photo of 60 x 40"):
        BoxMasks().mask(PHOTO, Box(70, 0, 80, 10))
