from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from cadpose.evaluation.outline_report import FOUND, Outlined, draw_outlines, worst_typical_best
from cadpose.geometry.boxes import Box


def row(photo: Path, shift: int | None) -> Outlined:
    true = np.zeros((80, 120), bool)
    true[20:60, 30:90] = True
    found = None if shift is None else np.roll(true, shift, axis=1)
    return Outlined(photo, "car", Box(30, 20, 90, 60), true, (("net: IoU 0.5", found),))


def orange(rows: list[Outlined]) -> int:
    sheet = np.asarray(draw_outlines(rows, ("true", "found"))).astype(int)
    return int((np.abs(sheet[60:] - FOUND).sum(axis=2) < 90).sum())


def test_outlines_are_drawn_over_the_photo_and_without_it(tmp_path: Path) -> None:
    photo = tmp_path / "a.png"
    Image.new("RGB", (120, 80), (30, 60, 90)).save(photo)
    assert orange([row(photo, 10)]) > 200
    assert orange([row(photo, 10), row(photo, 5)]) > 400
    photo.unlink()
    assert orange([row(photo, 10)]) > 200


def test_a_way_that_found_nothing_is_shown_without_its_outline(tmp_path: Path) -> None:
    assert orange([row(tmp_path / "gone.png", None)]) == 0
    draw_outlines([], ("true", "found"))


def test_the_sheets_hold_no_object_twice() -> None:
    sheets = worst_typical_best(range(60), 4)
    assert list(sheets["worst"]) == [0, 1, 2, 3] and list(sheets["best"]) == [59, 58, 57, 56]
    assert list(sheets["typical"]) == [28, 29, 30, 31]
    for n in range(1, 12):
        sheets = worst_typical_best(range(n), 4)
        shown = [i for few in sheets.values() for i in few]
        assert len(shown) == len(set(shown)) and len(sheets["worst"]) >= 1
