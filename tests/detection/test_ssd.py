from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.detection.ssd import QUARTERS, RawBoxes, Ssd


class FakeNet:
    """Answers each picture with one box, given in shares of that picture."""

    def __init__(self, box: tuple[float, float, float, float], score: float = 0.9) -> None:
        self.row = [0.0, 3.0, score, *box]
        self.calls = 0

    def setInput(self, blob: NDArray[np.float32]) -> None:
        assert blob.shape == (1, 3, 300, 300)
        self.calls += 1

    def forward(self) -> NDArray[np.float32]:
        return np.array([[[self.row]]], np.float32)


def ssd(net: FakeNet) -> Ssd:
    made = Ssd()
    made.__dict__["_net"] = net
    return made


PHOTO = np.zeros((500, 1000, 3), np.uint8)


def test_whole_photo_and_quarters_in_photo_pixels() -> None:
    net = FakeNet((0.25, 0.2, 0.75, 0.6))
    raw = ssd(net).boxes(PHOTO)
    assert net.calls == len(raw) == 1 + len(QUARTERS)
    np.testing.assert_allclose(raw.boxes[0], [250, 100, 750, 300], atol=1e-3)
    np.testing.assert_allclose(raw.boxes[2], [400 + 150, 60, 400 + 450, 180], atol=1e-3)
    assert (raw.classes == 3).all()


def test_small_photos_are_seen_whole_only() -> None:
    net = FakeNet((0.25, 0.2, 0.75, 0.6))
    assert len(ssd(net).boxes(PHOTO[:200])) == 1
    assert len(ssd(net).boxes(PHOTO, tiles=False)) == 1


def test_a_box_cut_by_a_quarters_inner_border_is_dropped() -> None:
    raw = ssd(FakeNet((0.3, 0.3, 0.999, 0.7))).boxes(PHOTO)  # touches the right border
    assert len(raw) == 3  # the photo itself, and the two quarters whose right border is the photo's


def test_scores_below_the_floor_and_boxes_that_are_none() -> None:
    assert len(ssd(FakeNet((0.3, 0.3, 0.8, 0.7), score=0.04)).boxes(PHOTO, tiles=False)) == 0
    assert len(ssd(FakeNet((0.3, 0.3, 0.3, 0.7))).boxes(PHOTO, tiles=False)) == 0
    assert len(ssd(FakeNet((0.3, np.nan, 0.5, 0.7))).boxes(PHOTO, tiles=False)) == 0


def test_boxes_stay_inside_the_photo() -> None:
    raw = ssd(FakeNet((-0.2, -0.1, 1.3, 1.01))).boxes(PHOTO, tiles=False)
    np.testing.assert_allclose(raw.boxes, [[0, 0, 1000, 500]])


def test_raw_boxes_must_fit_together() -> None:
    with pytest.raises(ValueError, match="differ"):
        RawBoxes(boxes=np.zeros((2, 4)), classes=np.zeros(1, np.int64), scores=np.zeros(2))
