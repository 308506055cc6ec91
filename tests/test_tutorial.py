"""The tutorial, followed literally, does what it says and draws the pictures that it shows."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.tutorial import DOCS, differences, follow, parts, picture_difference


def test_the_page_is_read_whole() -> None:
    kinds = [part.kind for part in parts()]
    assert {kind: kinds.count(kind) for kind in set(kinds)} == {
        "file": 3, "commands": 11, "output": 4, "picture": 5,
    }  # fmt: skip
    assert all(part.name for part in parts() if part.kind == "file"), "every file has a title, its name"
    assert all((DOCS / part.text).is_file() for part in parts() if part.kind == "picture")


def test_outputs_are_compared() -> None:
    row = "│ coffee.jpg │ espresso │ 0.98 │ 293° +54° -3° │ 1279 px │"
    assert differences(row, f"header\n{row.replace('1279', '1281').replace(' 0.98', '  0.97')}\n") == []
    assert differences(row, row.replace("293", "113")) == [row]
    assert differences(row, row.replace("0.98", "0.68")) == [row]
    assert differences(row, row.replace("espresso", "mug")) == [row]
    assert differences("4 models, 0 failed", "3 models, 1 failed") == ["4 models, 0 failed"]
    assert differences("red [[197. 308.]]", "red [[198. 306.]]") == []
    assert differences("red [[197. 308.]]", "red [[197. 340.]]") == ["red [[197. 308.]]"]


def test_pictures_are_compared(tmp_path: Path) -> None:
    grey = np.full((40, 60, 3), 120, np.uint8)
    other = grey.copy()
    other[10:30, 10:40] = 250
    for name, rgb in (("a.png", grey), ("b.png", other), ("c.png", grey[:20])):
        Image.fromarray(rgb).save(tmp_path / name)
    assert picture_difference(tmp_path / "a.png", tmp_path / "a.png") == 0
    assert picture_difference(tmp_path / "a.png", tmp_path / "b.png") > 4
    assert picture_difference(tmp_path / "a.png", tmp_path / "c.png") == 255


@pytest.mark.slow
def test_the_tutorial_followed_literally(tmp_path: Path) -> None:
    pytest.importorskip("patchmatch", reason="PyPatchMatch is not installed: pip install 'cadpose[replace]'")
    if shutil.which("bash") is None:
        pytest.skip("bash is not here")
    assert follow(tmp_path) == []
