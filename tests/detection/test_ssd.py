from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.detection.ssd import QUARTERS, SIDE, RawBoxes, Ssd
from cadpose.weights import ensure


class FakeNet:
    """Answers each picture with one box, given in shares of that picture."""

    def __init__(self, box: tuple[float, float, float, float], score: float = 0.9) -> None:
        self.row = np.array([[3.0, score, *box]])
        self.calls = 0

    def __call__(self, small: NDArray[np.uint8], floor: float) -> NDArray[np.float64]:
        assert small.shape == (300, 300, 3)
        self.calls += 1
        return self.row


def ssd(net: FakeNet) -> Ssd:
    made = Ssd()
    made.__dict__["_network"] = net
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


def test_boxes_that_are_none() -> None:
    assert len(ssd(FakeNet((0.3, 0.3, 0.3, 0.7))).boxes(PHOTO, tiles=False)) == 0


def test_boxes_stay_inside_the_photo() -> None:
    raw = ssd(FakeNet((-0.2, -0.1, 1.3, 1.01))).boxes(PHOTO, tiles=False)
    np.testing.assert_allclose(raw.boxes, [[0, 0, 1000, 500]])


def test_raw_boxes_must_fit_together() -> None:
    with pytest.raises(ValueError, match="differ"):
        RawBoxes(boxes=np.zeros((2, 4)), classes=np.zeros(1, np.int64), scores=np.zeros(2))


def test_the_translated_network_answers_as_opencv_does() -> None:
    frozen, text = ensure("ssd-mobilenet-v2-coco"), ensure("ssd-mobilenet-v2-coco-graph")
    theirs = cv2.dnn.readNetFromTensorflow(str(frozen), str(text))
    noise = np.random.default_rng(0).integers(0, 256, (SIDE, SIDE, 3), dtype=np.uint8)
    picture = np.asarray(cv2.GaussianBlur(noise, (0, 0), 9), np.uint8)
    picture[80:220, 60:250] = (200, 40, 30)
    theirs.setInput(cv2.dnn.blobFromImage(picture))
    wanted = np.array(theirs.forward(), np.float64).reshape(-1, 7)[:, 1:]
    wanted = wanted[wanted[:, 1] > 0.0]
    wanted = wanted[np.argsort(-wanted[:, 1], kind="stable")]
    found = Ssd()._network(picture, 0.01)
    assert len(found) == len(wanted) > 5
    np.testing.assert_allclose(found, wanted, atol=1e-4)
