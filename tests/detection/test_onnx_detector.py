from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.detection.onnx_detector import OnnxDetector
from cadpose.errors import InputError
from cadpose.geometry.boxes import mask_iou
from cadpose.photos import read_photo
from cadpose.records import Photo
from tests.detection.heads import SIDE, bright_network, constant_network, described, write

pytest.importorskip("onnx")

CHAIR = np.array([[0.0, 0.9, 0.2]], np.float32)
#: x0, y0, x1, y1 of what is drawn, as shares of the photo.
WHERE = np.array([0.3, 0.2, 0.8, 0.6])


def photo_with_a_rectangle(width: int, height: int) -> tuple[Photo, np.ndarray[Any, Any]]:
    """A white rectangle on black, and its corners in pixels."""
    rgb = np.zeros((height, width, 3), np.uint8)
    corners = np.rint(WHERE * [width, height, width, height]).astype(int)
    rgb[corners[1] : corners[3], corners[0] : corners[2]] = 255
    return Photo(rgb), corners


INPUTS = [
    {"size": [128, 96], "resize": "stretch"},
    {"longest": 128, "multiple": 32, "resize": "stretch"},
    {"size": [128, 128], "resize": "letterbox", "pad": 0},
    {"size": [128, 96], "resize": "letterbox", "pad": 0, "place": "corner"},
    {"longest": 128, "multiple": 32, "resize": "letterbox", "pad": 0},
    {"size": [128, 128], "resize": "letterbox", "pad": 0, "layout": "nhwc", "channels": "bgr"},
]


@pytest.mark.parametrize("taken", INPUTS, ids=str)
@pytest.mark.parametrize(("width", "height"), [(640, 480), (300, 700), (90, 40)])
def test_what_is_drawn_comes_back_in_photo_pixels(
    tmp_path: Path, taken: dict[str, Any], width: int, height: int
) -> None:
    layout = taken.get("layout", "nchw")
    shape = (1, 3, "h", "w") if layout == "nchw" else (1, "h", "w", 3)
    network = bright_network(CHAIR, shape=shape, layout=layout)
    detector = OnnxDetector(write(tmp_path, described(input={"name": "image", **taken}), network))
    photo, corners = photo_with_a_rectangle(width, height)
    (d,) = detector.detect(photo)
    assert (d.category, d.source) == ("chair", "onnx") and d.score == pytest.approx(0.9)
    ((other, its_score),) = d.alternatives
    assert other == "table" and its_score == pytest.approx(0.2)
    step = max(width, height) / 64  # two pixels of the network
    np.testing.assert_allclose(d.box.to_tuple(), corners, atol=max(step, 1.5))
    truth = photo.rgb[..., 0] > 0
    assert d.mask is not None and d.mask.shape == (height, width) and mask_iou(d.mask, truth) > 0.85


def test_a_photo_that_exif_turns(tmp_path: Path) -> None:
    upright, corners = photo_with_a_rectangle(300, 480)
    lying = Image.fromarray(np.rot90(upright.rgb, 1))  # as a camera held upright stores it
    exif = Image.Exif()
    exif[0x0112] = 6
    lying.save(tmp_path / "turned.png", exif=exif)
    photo = read_photo(tmp_path / "turned.png")
    assert (photo.width, photo.height) == (300, 480)
    taken = {"name": "image", "size": [128, 128], "resize": "letterbox", "pad": 0}
    detector = OnnxDetector(write(tmp_path, described(input=taken), bright_network(CHAIR)))
    (d,) = detector.detect(photo)
    np.testing.assert_allclose(d.box.to_tuple(), corners, atol=7.5)
    assert d.mask is not None and mask_iou(d.mask, photo.rgb[..., 0] > 0) > 0.9


def test_thresholds_and_categories(tmp_path: Path) -> None:
    path = write(tmp_path, described(min_score=0.95), bright_network(CHAIR))
    photo, _ = photo_with_a_rectangle(100, 100)
    assert OnnxDetector(path).detect(photo) == []
    assert [d.category for d in OnnxDetector(path, min_score=0.5).detect(photo)] == ["chair"]
    (d,) = OnnxDetector(path, {"table", "lamp"}, min_score=0.1).detect(photo)
    assert d.category == "table" and d.score == pytest.approx(0.2)
    assert OnnxDetector(path, categories=[], min_score=0.1).detect(photo) == []


def test_the_name_tells_one_network_from_another(tmp_path: Path) -> None:
    def name(folder: str, network: np.ndarray[Any, Any] = CHAIR, **changes: Any) -> str:
        (tmp_path / folder).mkdir()
        return OnnxDetector(write(tmp_path / folder, described(**changes), bright_network(network))).name

    first = name("a")
    assert re.fullmatch(r"onnx:net@[0-9a-f]{12}", first) and name("b") == first
    assert len({first, name("c", CHAIR / 2), name("d", min_score=0.5)}) == 3


def outputs(**changes: Any) -> dict[str, Any]:
    whole = {
        "boxes": np.array([[[8, 8, 40, 40]]], np.float32),
        "scores": CHAIR[None],
        "masks": np.ones((1, 1, 16, 16), np.float32),
    }
    return {**whole, **changes}


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"boxes": np.zeros((1, 2, 4), np.float32)}, "2 x 4 boxes for 1 scores"),
        ({"boxes": np.full((1, 1, 4), np.nan, np.float32)}, "boxes that are no numbers"),
        ({"scores": CHAIR * 8}, "scores outside 0 to 1"),
        ({"masks": np.full((1, 1, 4, 4), np.nan, np.float32)}, "masks that are no numbers"),
    ],
)
def test_wrong_outputs_are_told_in_a_sentence(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    path = write(tmp_path, described(), constant_network(outputs(**changes)))
    with pytest.raises(InputError) as caught:
        OnnxDetector(path).detect(photo_with_a_rectangle(50, 50)[0])
    message = str(caught.value)
    assert said in message and "net.onnx" in message and "net.json" in message and "\n" not in message


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"input": {"name": "x", "size": [SIDE, SIDE], "resize": "stretch"}}, "inputs are image, not x"),
        (
            {"input": {"name": "image", "size": [32, 32], "resize": "stretch"}},
            r"takes the shape \[1, 3, 64, 64\]",
        ),
        (
            {"boxes": {"output": "b", "form": "xyxy", "unit": "pixels"}},
            "no output b; it has boxes, masks, scores",
        ),
    ],
)
def test_descriptions_of_another_network(tmp_path: Path, changes: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        OnnxDetector(write(tmp_path, described(**changes), constant_network(outputs())))


def test_a_file_that_is_no_network_and_one_that_does_not_run(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"net\.onnx cannot be run as an ONNX file"):
        OnnxDetector(write(tmp_path, described(), b"no network"))
    taken = {"name": "image", "longest": 32, "resize": "stretch"}
    detector = OnnxDetector(write(tmp_path, described(input=taken), constant_network(outputs())))
    with pytest.raises(InputError, match="does not run on an input of 32 x 32 pixels") as caught:
        detector.detect(photo_with_a_rectangle(50, 50)[0])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", [np.uint8, np.float16])
def test_other_types_of_input(tmp_path: Path, kind: type[np.generic]) -> None:
    network = constant_network(outputs(), kind)
    taken = {"name": "image", "size": [SIDE, SIDE], "resize": "stretch", "scale": 1}
    (d,) = OnnxDetector(write(tmp_path, described(input=taken), network)).detect(
        photo_with_a_rectangle(64, 64)[0]
    )
    assert d.box.to_tuple() == (8.0, 8.0, 40.0, 40.0)
    if kind is np.uint8:
        with pytest.raises(InputError, match=r"input\.scale should be 1"):
            OnnxDetector(write(tmp_path, described(), network))
