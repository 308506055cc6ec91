"""`cadpose evaluate detection` and `masks`, and rotations at detected boxes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from cadpose import backends
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo, Rotation, RotationHypothesis
from tests.cli.invoking import cadpose, one_sentence, said
from tests.evaluation.detecting import Says, perfect, shifted, write_coco
from tests.small_library import save, shoot

TRUE = Rotation(35, 12, 4)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> Iterator[dict[str, Any]]:
    """Detectors by name, in place of the real ones."""
    detectors = {"embedded": Says(perfect()), "ssd": Says(shifted())}
    monkeypatch.setattr(backends, "make_detector", lambda name, *_: detectors[name])
    yield detectors


def test_detectors_side_by_side(tmp_path: Path, made: dict[str, Any]) -> None:
    coco = write_coco(tmp_path)
    run = ["evaluate", "detection", coco, "--detector", "ssd", "--detector", "embedded", "--detector", "ssd"]
    result = cadpose(*run, "--report", tmp_path / "report", "--csv", tmp_path / "t.csv")
    assert result.exit_code == 0, result.output
    assert f"Report: {tmp_path / 'report' / 'report.html'}" in result.stdout
    assert (tmp_path / "report" / "sheet-2-embedded.jpg").is_file() and (tmp_path / "t.csv").is_file()
    told = said(cadpose(*run, "--json"))
    assert {n: d["ap"] for n, d in told["detectors"].items()} == {"ssd": 0.0, "embedded": 1.0}
    assert said(cadpose("evaluate", "detection", coco, "--json", "--category", "armchair"))["objects"] == 1
    assert said(cadpose("evaluate", "detection", coco, "--json", "--smallest", 0))["objects"] == 4
    assert said(cadpose("evaluate", "detection", coco, "--json", "--limit", 2))["photos"] == 2
    masked = said(cadpose("evaluate", "detection", coco, "--json", "--masks", "none"))
    assert masked["detectors"]["embedded"]["mask_ap"] == 1.0


def test_what_cannot_be_evaluated(tmp_path: Path, made: dict[str, Any]) -> None:
    coco = write_coco(tmp_path)
    assert cadpose("evaluate", "detection", coco, "--detector", "best").exit_code == 2
    assert cadpose("evaluate", "masks", coco, "--masks", "best").exit_code == 2
    assert "network (unless told)" in " ".join(
        cadpose("evaluate", "masks", "--help").stdout.replace("│", " ").split()
    )
    assert cadpose("evaluate", "masks", coco, "--jitter", "nan").exit_code == 2
    one_sentence(cadpose("evaluate", "detection", tmp_path / "gone.json"), "gone.json")
    one_sentence(cadpose("evaluate", "detection", coco, "--csv", coco), "--csv", "written over")
    one_sentence(cadpose("evaluate", "masks", coco, "--category", "sofa"), "no object with a mask")
    (tmp_path / "b.png").unlink()
    result = cadpose("evaluate", "detection", coco)
    assert (
        result.exit_code == 1 and "b.png" in result.stderr and "1 photos could not be used" in result.stdout
    )


def test_masks_side_by_side(tmp_path: Path) -> None:
    run = ["evaluate", "masks", write_coco(tmp_path), "--masks", "none", "--masks", "grabcut"]
    result = cadpose(*run, "--report", tmp_path / "report", "--csv", tmp_path / "t.csv")
    assert result.exit_code == 0 and (tmp_path / "report" / "worst.jpg").is_file(), result.output
    told = said(cadpose(*run, "--json", "--jitter", "0.05"))
    assert "moved by up to 5%" in told["boxes"]
    assert 0.5 < told["masks"]["none"]["mean_iou"] < 1.0 and told["masks"]["grabcut"]["n"] == 3


def test_rotations_at_detected_boxes(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    names = ("a.png", "b.png", "c.png")
    for name in names:
        save(tmp_path / name, shot.photo.rgb)
    box = list(shot.box.to_tuple())
    angles = {"azimuth": TRUE.azimuth, "elevation": TRUE.elevation, "inplane": TRUE.inplane}
    labels = tmp_path / "labels.json"
    labels.write_text(
        json.dumps([{"photo": name, "category": "car", "box": box, **angles} for name in names])
    )
    near, far = shot.box.scaled(0.95), Box(0, 0, 20, 20)
    says = Says(
        {
            "a.png": [Detection(far, "car", 0.9), Detection(near, "car", 0.8)],
            "b.png": [Detection(far, "car", 0.9)],
            "c.png": [Detection(near, "chair", 0.9)],
        }
    )
    monkeypatch.setattr(backends, "make_detector", lambda *_: says)
    shown: list[Box] = []

    def estimate(self: Annotator, photo: Photo, box: Box, *_: Any) -> list[RotationHypothesis]:
        shown.append(box)
        return [RotationHypothesis(TRUE, 1.0, 0.9, 8.0)]

    monkeypatch.setattr(Annotator, "estimate_rotation", estimate)
    run = ["evaluate", "rotation", labels, "--library", small_library.path]
    result = cadpose(*run, "--boxes", "detected", "--detector", "ssd", "--report", tmp_path / "report")
    # What the detector does not find is measured, not broken.
    assert result.exit_code == 0 and result.stderr == "", result.output
    assert shown == [near]
    assert "Acc@30 of all" in result.stdout
    assert "no object was found at the labelled box (1); car taken for chair (1)" in result.stdout
    page = (tmp_path / "report" / "report.html").read_text()
    assert "detected (says)" in page
    # Asked once a photo, for the sheet too.
    assert len(says.asked) == 3
    table = said(cadpose(*run, "--boxes", "detected", "--json"))
    assert (table["n"], table["lost"], table["acc30"]) == (1, 2, 1.0)
    assert table["yield"] == table["acc30_all"] == table["acc10_all"] == pytest.approx(1 / 3)
    low, high = table["acc30_all_interval"]
    assert low < 1 / 3 < high
    plain = said(cadpose(*run, "--json"))
    assert (plain["lost"], plain["n"], plain["acc30_all"]) == (0, 3, 1.0)
    assert cadpose(*run, "--boxes", "detected", "--jitter", "0.1").exit_code == 2
