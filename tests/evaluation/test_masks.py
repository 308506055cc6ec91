from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from cadpose.datasets.scene_sets import open_scenes
from cadpose.detection.box_masks import BoxMasks
from cadpose.evaluation.mask_quality import TOLERANCE, boundary_f, outline
from cadpose.evaluation.mask_report import write_mask_report
from cadpose.evaluation.mask_tables import MaskFigures, mask_tables
from cadpose.evaluation.masks import MaskOutcome, evaluate_masks
from cadpose.evaluation.outline_report import report_files
from cadpose.evaluation.perturbations import Perturbation
from cadpose.geometry.boxes import Box
from cadpose.records import Mask, Photo
from tests.evaluation.detecting import write_coco

MASKS = arrays(np.bool_, (12, 17))


class Left:
    """The left half of the box."""

    name = "left"

    def mask(self, photo: Photo, box: Box) -> Mask:
        return BoxMasks().mask(photo, Box(box.x0, box.y0, box.x0 + box.width / 2, box.y1))


def disc(radius: float, x: float = 50.0, size: int = 100) -> Mask:
    v, u = np.mgrid[0:size, 0:size] + 0.5
    return np.asarray((u - x) ** 2 + (v - 50.0) ** 2 <= radius**2)


def scored(tmp_path: Path, jitter: float = 0.0) -> list[MaskOutcome]:
    scenes = open_scenes(write_coco(tmp_path))
    outcomes, failed = evaluate_masks(
        scenes.scenes,
        {"none": BoxMasks(), "left": Left()},
        scenes.categories,
        perturbation=Perturbation(jitter) if jitter else None,
    )
    assert failed == []
    return outcomes


@given(MASKS, MASKS)
def test_boundary_f_is_symmetric_and_between_0_and_1(a: Mask, b: Mask) -> None:
    assert 0.0 <= boundary_f(a, b) <= 1.0 and boundary_f(a, b) == pytest.approx(boundary_f(b, a))
    assert boundary_f(a, a) == 1.0


def test_boundary_f_forgives_what_is_near() -> None:
    # 100 x 100 pixels: two pixels of tolerance.
    assert TOLERANCE == 0.008 and boundary_f(disc(30), disc(31)) == 1.0
    assert boundary_f(disc(30), disc(36)) == 0.0
    assert 0.2 < boundary_f(disc(30), disc(30, 56.0)) < 0.7
    # What is far away counts, however small it is.
    specked = disc(30)
    specked[2:4, 2:4] = True
    assert 0.95 < boundary_f(specked, disc(30)) < 1.0


def test_the_outline() -> None:
    square = np.zeros((10, 10), np.bool_)
    square[2:7, 3:8] = True
    assert outline(square).sum() == 16 and outline(square)[2, 3] and not outline(square)[4, 5]
    # Where the photo ends the object need not.
    assert outline(np.ones((5, 5), np.bool_)).sum() == 0
    half = np.zeros((6, 6), np.bool_)
    half[:, :3] = True
    assert np.flatnonzero(outline(half).any(axis=0)).tolist() == [2]
    assert boundary_f(np.ones((6, 6), np.bool_), half) == 0.0 and boundary_f(half, half) == 1.0
    nothing = np.zeros((6, 6), np.bool_)
    assert boundary_f(nothing, nothing) == 1.0 and boundary_f(nothing, half) == 0.0
    with pytest.raises(ValueError, match="cannot be compared"):
        boundary_f(half, square)


def test_true_masks_and_halves_of_them(tmp_path: Path) -> None:
    outcomes = scored(tmp_path)
    # The cup is too small.
    assert [o.category for o in outcomes] == ["car", "car", "chair"]
    made = mask_tables(outcomes, dataset="mini")
    assert made.total["none"].mean == made.total["none"].median == made.total["none"].boundary == 1.0
    assert made.total["none"].good == 3 and made.total["left"].good == 0
    assert made.total["left"].mean == pytest.approx(0.5, abs=0.01) and made.total["left"].boundary < 0.9
    assert set(made.by_category) == {"car", "chair"} and made.by_category["car"]["left"].objects == 2
    assert "IoU >= 0.9, % [95 %]" in made.to_text()
    assert "100.0 [43.9, 100.0]" in made.to_text() and "real photos" in made.to_text()
    rows = list(csv.DictReader(io.StringIO(made.to_csv())))
    assert len(rows) == 6 and rows[0]["mean_iou"] == "1.00000"
    told = made.to_json()["masks"]["left"]
    assert told["n"] == 3 and told["good"] == 0.0 and set(told["classes"]) == {"car", "chair"}


def test_jitter_moves_the_boxes_alike_in_every_run(tmp_path: Path) -> None:
    plain, moved, again = scored(tmp_path), scored(tmp_path, 0.1), scored(tmp_path, 0.1)
    assert [o.box for o in moved] == [o.box for o in again] != [o.box for o in plain]
    assert all(0.5 < o.scores["none"].iou < 1.0 for o in moved)


def test_the_report(tmp_path: Path) -> None:
    outcomes = scored(tmp_path)
    made = mask_tables(outcomes, dataset="mini")
    page = write_mask_report(tmp_path / "report", made, outcomes, {"Device": "cpu"})
    names = sorted(p.name for p in (tmp_path / "report").iterdir())
    assert names == sorted(p.name for p in report_files(tmp_path / "report"))
    assert "Boundary F" in page.read_text()
    entries = [json.loads(line) for line in (tmp_path / "report" / "results.jsonl").read_text().splitlines()]
    assert len(entries) == 3 and set(entries[0]["masks"]) == {"none", "left"}


def test_nothing_to_compare() -> None:
    with pytest.raises(ValueError, match="no mask was compared"):
        mask_tables([], dataset="mini")
    with pytest.raises(ValueError, match="no mask"):
        MaskFigures.of([])
