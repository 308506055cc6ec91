from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from cadpose.annotations.detections_page import found_entry, found_html
from cadpose.geometry.boxes import Box
from cadpose.records import Detection
from tests.annotations.test_pages import HOSTILE, assert_inert
from tests.html_page import Page

BOX = Box(1, 1, 9, 9)
PICTURE = Image.fromarray(np.zeros((600, 960, 3), np.uint8))


def test_every_photo_links_to_its_picture_and_says_what_was_found() -> None:
    found = [
        Detection(BOX, "chair", 0.9, truncated=True),
        Detection(BOX, "chair", 0.4, truncated=True, unsure=True, alternatives=(("sofa", 0.3),)),
    ]
    entries = [
        found_entry(Path("a/one.jpg"), Path("out/one.detections.png"), PICTURE, found),
        found_entry(Path("a/two.jpg"), Path("out/two.detections.png"), PICTURE, []),
    ]
    html = found_html(entries)
    assert_inert(html)
    page = Page(html)
    assert "2 photos, 2 objects found" in page.text
    assert "chair 0.90 · unsure: chair / sofa 0.40" in page.text and "no object found" in page.text
    assert "2 truncated" in page.text and "1 unsure" in page.text and "tiny" not in page.text
    assert [a["href"] for tag, a in page.tags if tag == "a"] == [
        "./one.detections.png",
        "./two.detections.png",
    ]
    assert all(max(picture.size) <= 500 for picture in page.pictures()) and len(page.pictures()) == 2


def test_names_are_escaped() -> None:
    entry = found_entry(Path(HOSTILE), Path(HOSTILE), PICTURE, [Detection(BOX, HOSTILE, 0.5)])
    assert_inert(found_html([entry], HOSTILE))
    assert "1 photo, 1 object found" in found_html([entry])
