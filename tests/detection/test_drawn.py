from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.detection import DetectionSource, reading
from cadpose.detection.drawn import DrawnObjects
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Photo

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8), name="img_1.jpg")
TRIANGLE = [10.0, 10.0, 30.0, 10.0, 10.0, 30.0]


def mask_file(folder: Path, name: str, count: int = 2) -> Path:
    """Two rows an object."""
    pixels = np.zeros((40, 60), np.uint8)
    for i in range(count):
        pixels[4 * i : 4 * i + 2] = i + 1
    Image.fromarray(pixels).save(folder / name)
    return folder / name


def test_boxes_polygons_and_masks_in_that_order(tmp_path: Path) -> None:
    names = ["car", "bed", "chair", "clock"]
    made: DetectionSource = DrawnObjects([Box(0, 0, 5, 5)], [TRIANGLE], [mask_file(tmp_path, "m.png")], names)
    found = made.detect(PHOTO)
    assert [d.category for d in found] == names and [d.mask is None for d in found] == [True] + [False] * 3
    assert made.knows("anything.jpg")
    with pytest.raises(InputError, match="shows no object"):
        DrawnObjects(masks=[mask_file(tmp_path, "none.png", 0)]).detect(PHOTO)


def test_masks_of_all_files_and_polygons_count_together(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 3 * 60 * 40)
    path = mask_file(tmp_path, "m.png")
    assert len(DrawnObjects([Box(0, 0, 5, 5)] * 5, [TRIANGLE], [path], ["car"]).detect(PHOTO)) == 8
    with pytest.raises(InputError, match=r"2 masks of img_1\.jpg besides 2 from elsewhere"):
        DrawnObjects(masks=[path] * 2, categories=["car"]).detect(PHOTO)
    with pytest.raises(InputError, match="besides 2 from elsewhere"):
        DrawnObjects(polygons=[TRIANGLE] * 2, masks=[path], categories=["car"]).detect(PHOTO)
    with pytest.raises(InputError, match="the command line has 4 masks"):
        DrawnObjects(polygons=[TRIANGLE] * 4, categories=["car"]).detect(PHOTO)
