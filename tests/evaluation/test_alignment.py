from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from cadpose.alignment.placement import Placement
from cadpose.alignment.refinement.refine import Refiner
from cadpose.datasets.label import Label, RunLengths
from cadpose.encoder import lite0
from cadpose.evaluation.alignment import CEILING, AlignmentOutcome, Ways, evaluate_alignment
from cadpose.evaluation.alignment_report import write_alignment_report
from cadpose.evaluation.alignment_tables import alignment_tables
from cadpose.evaluation.alignment_truth import TrueModel, true_pixels
from cadpose.evaluation.detection_run import runs_of
from cadpose.evaluation.outline_report import PAGE, report_files
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.poses import Rotation
from cadpose.rendering.raster import Rasteriser
from tests.small_library import Shot, save, shoot

ROTATIONS = {"made/car/hatch.obj": Rotation(40.0, 12.0), "made/car/van.glb": Rotation(300.0, 8.0, 3.0)}


def label_of(shot: Shot, path: Path) -> Label:
    R = shot.rotation.to_matrix()
    a, b, c = (tuple(float(v) for v in row) for row in R)
    return Label(
        save(path, shot.photo.rgb), "car", shot.box, shot.cad.id,
        shot.rotation.azimuth, shot.rotation.elevation, shot.rotation.inplane, runs_of(shot.mask),
        focal_px=shot.focal_px, principal_px=(210.0, 140.0), R_cv_from_s=(a, b, c),  # type: ignore[arg-type]
        t_cv=(0.0, 0.0, 2.0), synthetic=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def labels(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> list[Label]:
    folder = tmp_path_factory.mktemp("photos")
    return [
        label_of(shoot(small_library, cad, rotation), folder / f"{i}.png")
        for i, (cad, rotation) in enumerate(ROTATIONS.items())
    ]


@pytest.fixture(scope="module")
def annotator(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Annotator:
    return Annotator(small_library, masks="none", cache=tmp_path_factory.mktemp("cache"))


@pytest.fixture(scope="module")
def outcomes(labels: list[Label], annotator: Annotator) -> list[AlignmentOutcome]:
    refiner = Refiner(lite0())
    placements = {m: Placement(Rasteriser(), "box", refiner, m) for m in ("off", "fast")}
    found, failed = evaluate_alignment(
        labels, annotator, Ways(placements, true_rotation=True, true_masks=True)
    )
    assert failed == []
    return found


def test_a_photo_of_the_model_at_its_rotation_is_met(outcomes: list[AlignmentOutcome]) -> None:
    for outcome, cad in zip(outcomes, ROTATIONS, strict=True):
        assert outcome.cad == cad
        assert outcome.labelled_mask
        assert list(outcome.scores) == ["off", "fast", CEILING]
        for score in outcome.scores.values():
            assert score.rotation_error < 1e-3
            assert score.silhouette_iou > 0.93
            assert score.box_iou > 0.93
            assert score.add is not None
            assert score.add < 0.02
        assert outcome.scores["fast"].silhouette_iou >= outcome.scores["off"].silhouette_iou - 5e-3


def test_tables_and_report_tell_every_way(outcomes: list[AlignmentOutcome], tmp_path: Path) -> None:
    tables = alignment_tables(
        outcomes, dataset="made.jsonl", synthetic=True, facts={"Start": "labelled rotation"}
    )
    assert "SYNTHETIC" in tables.title
    told = tables.to_json()
    assert set(told["refine"]) == {"off", "fast", CEILING}
    assert told["refine"]["off"]["acc10"] == 1.0
    assert told["refine"]["off"]["classes"]["car"]["n"] == 2
    header, *rows = tables.to_csv().splitlines()
    assert len(rows) == 6
    assert all(len(row.split(",")) == len(header.split(",")) for row in rows)
    page = write_alignment_report(tmp_path / "report", tables, outcomes)
    assert page.name == PAGE
    assert all(path.stat().st_size > 0 for path in report_files(tmp_path / "report"))
    entries = [json.loads(line) for line in (tmp_path / "report" / "results.jsonl").read_text().splitlines()]
    assert [entry["cad"] for entry in entries] == list(ROTATIONS)
    assert "ceiling" in tables.to_text()


def test_a_label_that_fails_is_told_and_the_others_go_on(labels: list[Label], annotator: Annotator) -> None:
    bad = replace(labels[0], cad="made/car/none.obj")
    ways = Ways({"off": Placement(Rasteriser())}, true_rotation=True)
    found, failed = evaluate_alignment([bad, labels[1]], annotator, ways)
    assert len(found) == 1
    assert failed[0][0] == str(bad.photo)
    assert "none.obj" in failed[0][1]


def test_the_estimated_start_is_taken_to_the_model(labels: list[Label], annotator: Annotator) -> None:
    ways = Ways({"off": Placement(Rasteriser())}, chosen=True)
    (outcome,), failed = evaluate_alignment(labels[:1], annotator, ways)
    assert failed == []
    assert outcome.cad in {m.id for m in annotator.library.models("car")}
    assert isinstance(outcome.truth, RunLengths)


def test_a_file_of_the_data_set_is_seen_where_its_camera_saw_it(tmp_path: Path, labels: list[Label]) -> None:
    # A box off the origin of its file, in metres: loading moves it there, the label does not.
    box = trimesh.creation.box(bounds=[[1.0, 0.0, -2.0], [3.0, 1.5, 2.0]])
    path = tmp_path / "box.obj"
    path.write_text(
        "\n".join(
            [f"v {x} {y} {z}" for x, y, z in box.vertices] + [f"f {a} {b} {c}" for a, b, c in box.faces + 1]
        )
    )
    label = replace(labels[0], cad="set/box", cad_path=path, t_cv=(-2.0, 0.5, 12.0))
    model = TrueModel.of(label, Library.__new__(Library))
    there = true_pixels(label, model)
    assert there is not None
    K, R = label.K, np.array(label.R_cv_from_s)
    assert K is not None
    x_cv = np.asarray(box.vertices) @ R.T + [-2.0, 0.5, 12.0]
    pixels = x_cv @ K.T
    expected = pixels[:, :2] / pixels[:, 2:]
    for pixel in expected:
        assert np.linalg.norm(there - pixel, axis=1).min() < 1e-3
    assert true_pixels(replace(label, cad="set/other"), model) is None
    assert true_pixels(replace(label, t_cv=None), model) is None
