from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import azimuth_error, flip_angles
from cadpose.geometry.boxes import Box
from cadpose.records import (
    Annotation,
    CadModel,
    Candidate,
    Detection,
    Photo,
    PhotoCamera,
    Pose4Dof,
    Pose6Dof,
    Refinement,
    Rotation,
    RotationHypothesis,
    Views,
)

NAN, INF = math.nan, math.inf
ROTATION = Rotation(40.0, 10.0, 5.0)
CAD = CadModel(id="lib/car.obj", name="Car", category="car")
DETECTION = Detection(box=Box(1.0, 2.0, 30.0, 40.0), category="car")
CAMERA = PhotoCamera(500.0, (320.0, 240.0))
POSE = Pose4Dof(rotation=ROTATION, focal_px=300.0, principal_px=(15.5, 21.0))
rotations = st.builds(Rotation, st.floats(-720, 720), st.floats(-90, 90), st.floats(-720, 720))


def photo_of(height: int = 4, width: int = 6) -> Photo:
    return Photo(rgb=np.zeros((height, width, 3), np.uint8))


def views_of(count: int = 2, **changes: Any) -> Views:
    arrays: dict[str, Any] = {
        "rgb": np.zeros((count, 4, 6, 3), np.uint8),
        "alpha": np.zeros((count, 4, 6), np.uint8),
        "depth": np.full((count, 4, 6), np.inf, np.float32),
    }
    return Views(**(arrays | changes))


GOOD: dict[type, dict[str, Any]] = {
    Photo: {"rgb": np.zeros((4, 6, 3), np.uint8)},
    Rotation: {"azimuth": 1.0, "elevation": 2.0},
    RotationHypothesis: {"rotation": ROTATION, "score": 0.5},
    Detection: {"box": Box(0, 0, 1, 1), "category": "car"},
    CadModel: {"id": "a", "name": "b", "category": "c"},
    Candidate: {"cad": CAD, "score": 1.0, "rotation": ROTATION},
    Pose4Dof: {"rotation": ROTATION, "focal_px": 1.0, "principal_px": (0.0, 0.0)},
    PhotoCamera: {"focal_px": 500.0, "principal_px": (320.0, 240.0)},
    Pose6Dof: {"R_cv_from_s": np.eye(3), "t_cv": np.array([0.0, 0.1, 4.0]), "camera": CAMERA},
    Refinement: {"mode": "fast", "start": POSE, "start_score": 0.5, "score": 0.75, "evaluations": 40},
    Views: {
        "rgb": np.zeros((1, 2, 2, 3), np.uint8),
        "alpha": np.zeros((1, 2, 2), np.uint8),
        "depth": np.zeros((1, 2, 2), np.float32),
    },
    Annotation: {
        "photo_name": "a.jpg",
        "photo_sha256": "",
        "photo_size": (640, 480),
        "detection": DETECTION,
        "pose": POSE,
        "candidates": (Candidate(CAD, 1.0, ROTATION),),
        "hypotheses": (),
        "box_iou": 0.9,
    },
}

BAD: list[tuple[type, dict[str, Any], str]] = [
    (Photo, {"rgb": np.zeros((4, 6), np.uint8)}, "must be"),
    (Photo, {"rgb": np.zeros((4, 6, 4), np.uint8)}, "must be"),
    (Photo, {"rgb": np.zeros((4, 6, 3), np.float32)}, "float32"),
    (Photo, {"rgb": np.zeros((0, 6, 3), np.uint8)}, "must be"),
    (Rotation, {"azimuth": NAN}, "finite"),
    (Rotation, {"inplane": INF}, "finite"),
    (Rotation, {"elevation": 90.001}, "outside"),
    (Rotation, {"elevation": -91.0}, "outside"),
    (RotationHypothesis, {"score": NAN}, "finite"),
    (RotationHypothesis, {"probability": 1.1}, "outside"),
    (RotationHypothesis, {"probability": NAN}, "outside"),
    (RotationHypothesis, {"expected_error": -0.1}, "expected error"),
    (RotationHypothesis, {"expected_error": 180.1}, "expected error"),
    (RotationHypothesis, {"expected_error": NAN}, "expected error"),
    (Detection, {"score": 1.1}, "outside"),
    (Detection, {"score": -0.1}, "outside"),
    (Detection, {"score": NAN}, "outside"),
    (Detection, {"category": ""}, "category"),
    (Detection, {"mask": np.zeros((4, 4), np.uint8)}, "bool"),
    (Detection, {"mask": np.zeros((4, 4, 1), np.bool_)}, "bool"),
    (CadModel, {"id": ""}, "an id and a category"),
    (CadModel, {"category": ""}, "an id and a category"),
    (Candidate, {"score": -INF}, "finite"),
    (Pose4Dof, {"focal_px": 0.0}, "positive"),
    (Pose4Dof, {"focal_px": -1.0}, "positive"),
    (Pose4Dof, {"focal_px": NAN}, "positive"),
    (Pose4Dof, {"t_z": 0.0}, "positive"),
    (Pose4Dof, {"t_z": INF}, "positive"),
    (Pose4Dof, {"principal_px": (NAN, 0.0)}, "finite"),
    (PhotoCamera, {"focal_px": 0.0}, "positive"),
    (PhotoCamera, {"focal_px": INF}, "positive"),
    (PhotoCamera, {"principal_px": (0.0, NAN)}, "finite"),
    (PhotoCamera, {"source": "guess"}, "given or exif"),
    (Pose6Dof, {"R_cv_from_s": 2.0 * np.eye(3)}, "rotation"),
    (Pose6Dof, {"R_cv_from_s": np.eye(4)}, "must be"),
    (Pose6Dof, {"t_cv": np.array([0.0, 0.0, -1.0])}, "before the camera"),
    (Pose6Dof, {"t_cv": np.array([0.0, NAN, 1.0])}, "finite"),
    (Pose6Dof, {"diagonal_m": 0.0}, "positive"),
    (Refinement, {"score": 0.25}, "worse than its start"),
    (Refinement, {"score": NAN}, "finite"),
    (Refinement, {"expected_error": 181.0}, "expected error"),
    (Views, {"rgb": np.zeros((2, 2, 2, 3), np.uint8)}, "do not fit"),
    (Views, {"depth": np.zeros((1, 2, 3), np.float32)}, "do not fit"),
    (Views, {"alpha": np.zeros((2, 2), np.uint8)}, "do not fit"),
    (Views, {"rgb": np.zeros((1, 2, 2, 3), np.float32)}, "uint8"),
    (Views, {"alpha": np.zeros((1, 2, 2), np.bool_)}, "uint8"),
    (Views, {"depth": np.zeros((1, 2, 2), np.float64)}, "float32"),
    (Annotation, {"candidates": ()}, "at least one CAD candidate"),
    (Annotation, {"photo_size": (0, 480)}, "positive"),
    (Annotation, {"box_iou": 1.01}, "box_iou"),
    (Annotation, {"box_iou": NAN}, "box_iou"),
    (Annotation, {"mask_iou": -0.01}, "mask_iou"),
    (Annotation, {"mask_iou": NAN}, "mask_iou"),
    (Annotation, {"confidence": 1.5}, "confidence"),
    (Annotation, {"verdict": "maybe"}, "verdict"),
]


@pytest.mark.parametrize(("record", "change", "message"), BAD)
def test_refuses_what_makes_no_sense(record: type, change: dict[str, Any], message: str) -> None:
    record(**GOOD[record])
    with pytest.raises(ValueError, match=message):
        record(**(GOOD[record] | change))


@pytest.mark.parametrize("record", GOOD)
def test_every_record_is_frozen(record: type) -> None:
    made = record(**GOOD[record])
    name = dataclasses.fields(made)[0].name
    with pytest.raises(dataclasses.FrozenInstanceError):
        setattr(made, name, None)


def test_every_record_is_tested_here() -> None:
    import cadpose.records as records

    homes = ("cadpose.records", "cadpose.poses")
    classes = {
        value
        for value in vars(records).values()
        if dataclasses.is_dataclass(value) and getattr(value, "__module__", "") in homes
    }
    assert classes == set(GOOD)
    refusing = {record for record in classes if hasattr(record, "__post_init__")}
    assert refusing == {record for record, _, _ in BAD}


def test_an_annotation_needs_review_where_its_first_hypothesis_does() -> None:
    plain = RotationHypothesis(Rotation(1, 2), 0.5)
    flagged = dataclasses.replace(plain, needs_review=True)
    for hypotheses, doubtful in (((), False), ((plain, flagged), False), ((flagged, plain), True)):
        assert Annotation(**(GOOD[Annotation] | {"hypotheses": hypotheses})).needs_review is doubtful


def test_photo_knows_its_size_and_cannot_be_painted_on() -> None:
    photo = photo_of(height=4, width=6)
    assert (photo.width, photo.height) == (6, 4)
    with pytest.raises(ValueError, match="read-only"):
        photo.rgb[0, 0, 0] = 1


@given(rotations)
def test_rotation_wraps_its_angles(rotation: Rotation) -> None:
    assert 0.0 <= rotation.azimuth < 360.0
    assert -180.0 < rotation.inplane <= 180.0
    assert type(rotation.azimuth) is type(rotation.elevation) is type(rotation.inplane) is float


def test_rotation_wraps_to_the_same_angle() -> None:
    assert Rotation(-90.0, 0.0, 270.0) == Rotation(270.0, 0.0, -90.0)
    assert Rotation(360.0, 0.0, -180.0) == Rotation(0.0, 0.0, 180.0)


@given(rotations)
def test_rotation_to_matrix_and_back(rotation: Rotation) -> None:
    again = Rotation.from_matrix(rotation.to_matrix())
    assert again.error_to(rotation) < 1e-4
    if abs(rotation.elevation) < 89.0:
        assert azimuth_error(again.azimuth, rotation.azimuth) < 1e-6
        assert again.elevation == pytest.approx(rotation.elevation, abs=1e-6)
        assert azimuth_error(again.inplane, rotation.inplane) < 1e-6


def test_error_to_is_the_geodesic_angle() -> None:
    assert Rotation(350.0, 0.0).error_to(Rotation(20.0, 0.0)) == pytest.approx(30.0)
    assert Rotation(0.0, 0.0).error_to(Rotation(180.0, 0.0)) == pytest.approx(180.0)
    a, e, i = flip_angles(40.0, 10.0, 5.0)
    assert Rotation(float(a), float(e), float(i)) == Rotation(320.0, 10.0, -5.0)


def test_pose_projects_as_equation_9() -> None:
    pose = Pose4Dof(rotation=Rotation(90.0, 0.0), focal_px=300.0, principal_px=(200.0, 100.0))
    # Own left side in view: front to image left, P'_W = (-0.4, -0.2, 0.1), z = 2.1.
    seen = pose.project(np.array([[0.1, 0.2, -0.4]]))
    np.testing.assert_allclose(seen, [[200.0 - 300.0 * 0.4 / 2.1, 100.0 - 300.0 * 0.2 / 2.1]])
    cameras = pose.to_cameras(640, 480)
    assert (cameras.width, cameras.height, len(cameras)) == (640, 480, 1)
    np.testing.assert_allclose(cameras.project(np.array([[0.1, 0.2, -0.4]]))[0], seen)


def test_views_mask_and_background() -> None:
    alpha = np.array([[[0, 127, 128, 255]]], np.uint8)
    rgb = np.full((1, 1, 4, 3), 100, np.uint8)
    views = Views(rgb=rgb, alpha=alpha, depth=np.ones((1, 1, 4), np.float32))
    np.testing.assert_array_equal(views.mask, [[[False, False, True, True]]])
    assert len(views) == 1
    over = views.over(200)
    assert over.dtype == np.uint8
    np.testing.assert_array_equal(over[0, 0, :, 0], [200, 150, 150, 100])
    np.testing.assert_array_equal(views_of().over(255), 255)


def test_the_answer_is_the_first_candidate() -> None:
    other = dataclasses.replace(CAD, id="lib/van.obj")
    annotation = Annotation(
        **(
            GOOD[Annotation]
            | {"candidates": (Candidate(other, 0.9, ROTATION), Candidate(CAD, 0.8, ROTATION))}
        )
    )
    assert annotation.cad is other


@pytest.mark.parametrize("background", [0, 1, 128, 255])
def test_compositing_is_exact_for_every_colour_and_coverage(background: int) -> None:
    alpha, level = np.meshgrid(np.arange(256), np.arange(256))
    views = Views(
        rgb=np.repeat(level[None, ..., None], 3, axis=-1).astype(np.uint8),
        alpha=alpha[None].astype(np.uint8),
        depth=np.ones((1, 256, 256), np.float32),
    )
    wanted = (level * alpha + background * (255 - alpha) + 127) // 255
    np.testing.assert_array_equal(views.over(background)[0], np.repeat(wanted[..., None], 3, axis=-1))
