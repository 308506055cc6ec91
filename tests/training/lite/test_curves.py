from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.errors import InputError
from cadpose.training.lite import curves
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.folder import begin


def test_rows_of_a_stopped_run_are_dropped(tmp_path: Path) -> None:
    first = Curves(tmp_path)
    for step in (50, 100, 150):
        first.add({"step": step, "pose": 1.0})
    again = Curves(tmp_path, 100)
    assert [row["step"] for row in again.rows] == [50, 100]
    again.add({"step": 100, "pose": 2.0})
    again.add({"step": 100, "unseen": True, "acc30": 0.5})
    told = [json.loads(line) for line in (tmp_path / "curves.jsonl").read_text().splitlines()]
    assert told == again.rows and [row.get("pose") for row in told] == [1.0, 2.0, None]
    assert Curves(tmp_path, 0).rows == [] and Curves(tmp_path).rows == told


def test_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib")
    rows = Curves(tmp_path)
    assert rows.draw() is None  # nothing to show
    for step in range(50, 1000, 50):
        rows.add({"step": step, "pose": 6.0 / step**0.2, "match": 2.0})
    rows.add({"step": 950, "unseen": True, "acc30": 0.6, "macro30": 0.5, "acc10": 0.2})
    path = rows.draw()
    assert path is not None
    with Image.open(io.BytesIO(path.read_bytes())) as picture:
        assert picture.size == (910, 780) and np.asarray(picture).std() > 10
    monkeypatch.setattr(curves, "find_spec", lambda _: None)
    assert rows.draw() is None


def test_a_folder_is_not_written_over(tmp_path: Path) -> None:
    told = {"seed": 1, "categories": ("a", "b")}
    with pytest.raises(InputError, match="leave out --resume"):
        begin(tmp_path, told, resume=True)
    begin(tmp_path, told, resume=False)
    with pytest.raises(InputError, match="add --resume"):
        begin(tmp_path, told, resume=False)
    begin(tmp_path, told, resume=True)
    with pytest.raises(InputError, match="other more, seed:"):
        begin(tmp_path, {**told, "seed": 2, "more": 1}, resume=True)
    (tmp_path / "settings.json").write_text("{")
    with pytest.raises(InputError, match="damaged"):
        begin(tmp_path, told, resume=True)
