"""The contact sheet shows photos with what is true of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.datasets.labels import Label, write_labels
from cadpose.geometry.boxes import Box
from cadpose.training.synth.sheet import sheet


def test_boxes_and_axes_are_where_they_belong(tmp_path: Path) -> None:
    labels = []
    for i in range(10):
        path = tmp_path / f"{i}.png"
        Image.new("RGB", (100, 100), (10 * i, 10 * i, 10 * i)).save(path)
        labels.append(
            Label(
                path, "chair", Box(20, 30, 80, 90), azimuth=0.0, elevation=0.0,
                focal_px=200.0, principal_px=(50.0, 60.0), t_cv=(0.0, 0.0, 2.0),
            )
        )  # fmt: skip
    write_labels(tmp_path / "l.jsonl", labels)
    page = np.asarray(sheet(tmp_path / "l.jsonl", most=4, columns=2, side=200))
    assert page.shape == (2 * 204 + 4, 2 * 204 + 4, 3)
    # Photos 0, 3, 6 and 9, by their grey in a corner that nothing is drawn on.
    greys = [page[y + 4 + 195, x + 4 + 195, 0] for y in (0, 204) for x in (0, 204)]
    assert greys == [0, 30, 60, 90]
    first = page[4:204, 4:204].astype(int)
    assert first[180, 100].tolist() == first[60, 130].tolist() == first[150, 40].tolist() == [255, 128, 0]
    # Seen from the front, the object's own right lies at image left, and up is up: 35 pixels long.
    assert first[120, 60, 0] > 200 and first[120, 60, 1] < 60
    assert first[70, 100, 1] > 150 and first[70, 100, 0] < 60
    assert first[110:130, 105:160].max() < 10


def test_a_sheet_needs_a_label(tmp_path: Path) -> None:
    (tmp_path / "l.jsonl").write_text("")
    with pytest.raises(ValueError, match="needs a labelled photo"):
        sheet(tmp_path / "l.jsonl")
