"""Snapping: the pipeline's refinement from where the person left the model."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from cadpose.annotations.document import document_from
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation, Candidate, Detection, Pose4Dof, Rotation
from cadpose.review import studio as studio_module
from cadpose.review.answers import SnapAnswer
from cadpose.review.refusals import RefusedError
from cadpose.review.shapes import PoseShape, RleShape
from cadpose.review.studio import Studio
from tests.review.serving import Served, serve
from tests.small_library import Shot, save, shoot

TRUE = Rotation(35.0, 12.0, 4.0)


@pytest.fixture(scope="module")
def shot(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", TRUE)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory, small_library: Library, shot: Shot) -> Iterator[Served]:
    folder = tmp_path_factory.mktemp("snap")
    photo = read_photo(save(folder / "street.png", shot.photo.rgb))
    pose = Pose4Dof(TRUE, shot.focal_px, (210.0, 140.0))
    found = Annotation(
        photo_name=photo.name,
        photo_sha256=photo.sha256,
        photo_size=(photo.width, photo.height),
        detection=Detection(shot.box, "car", mask=shot.mask),
        pose=pose,
        candidates=(Candidate(shot.cad, 1.0, TRUE),),
        hypotheses=(),
        box_iou=1.0,
    )
    served = serve(folder, small_library, photos=[folder])
    served.desk.store.add(document_from(photo, [found]))
    yield served
    served.close()


def body(served: Served, shot: Shot, **changes: Any) -> dict[str, Any]:
    start = Pose4Dof(Rotation(47.0, 17.0, 4.0), 1.08 * shot.focal_px, (214.0, 136.0))
    told = {
        "annotation_id": served.ids()[0],
        "cad_id": shot.cad.id,
        "pose": PoseShape.of(start).model_dump(),
        "mode": "full",
    }
    return told | changes


@pytest.mark.parametrize("mode", ["fast", "full"])
def test_it_comes_nearer(street: Served, shot: Shot, mode: str) -> None:
    asked = body(street, shot, mode=mode)
    told = SnapAnswer.model_validate(street.post("/api/snap", asked))
    start, pose = Rotation(47.0, 17.0, 4.0), told.pose.pose((400, 300))
    assert told.score > told.start_score and told.seconds > 0.0
    assert pose.rotation.error_to(TRUE) < start.error_to(TRUE)
    assert told.mask_iou is not None and told.mask_iou > 0.9 and told.box_iou > 0.9


def test_a_region_that_was_drawn_counts(street: Served, shot: Shot) -> None:
    moved = np.zeros_like(shot.mask)
    moved[:, 40:] = shot.mask[:, :-40]
    x0, y0, x1, y1 = shot.box.to_tuple()
    region = {"box": [x0 + 40, y0, x1 + 40, y1], "mask": RleShape.of(moved).model_dump()}
    start = body(street, shot)["pose"] | {"principal_px": [240.0, 140.0]}
    told = street.post("/api/snap", body(street, shot, region=region, pose=start))
    stays = street.post("/api/snap", body(street, shot, pose=start))
    # What is drawn pulls one way, what is seen the other.
    assert told["pose"]["principal_px"][0] > stays["pose"]["principal_px"][0] + 1.0
    assert told["start_score"] > stays["start_score"] and told["mask_iou"] < stays["mask_iou"]


def test_what_cannot_be_snapped(street: Served, shot: Shot, monkeypatch: pytest.MonkeyPatch) -> None:
    pose = body(street, shot)["pose"]
    for changes, status in (
        ({"annotation_id": "0" * 64}, 404),
        ({"annotation_id": "x"}, 422),
        ({"cad_id": "made/car/hutch.obj"}, 422),
        ({"mode": "off"}, 422),
        ({"pose": pose | {"t_z": 0.3}}, 422),
        ({"region": {"box": [0, 0, 0, 0], "mask": None}}, 422),
    ):
        told = street.post("/api/snap", body(street, shot, **changes), status)
        assert told["error"] and "\n" not in told["error"]
    monkeypatch.setattr(street.desk.photos, "folders", ())
    street.desk._decoded._held.clear()
    assert "--photos" in street.post("/api/snap", body(street, shot), 422)["error"]


def test_one_at_a_time(small_library: Library, shot: Shot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(studio_module, "PATIENCE", 0.05)
    studio = Studio()
    holding, done = threading.Event(), threading.Event()

    def hold() -> None:
        with studio._turn(studio._measuring):
            holding.set()
            done.wait(10)

    thread = threading.Thread(target=hold)
    thread.start()
    holding.wait(10)
    start = time.perf_counter()
    pose = Pose4Dof(TRUE, shot.focal_px, (210.0, 140.0))
    with pytest.raises(RefusedError, match="busy") as refused:
        studio.measure(small_library.mesh(shot.cad), pose, shot.box, shot.mask)
    assert refused.value.kind == "busy" and time.perf_counter() - start < 5.0
    done.set()
    thread.join()
    assert studio.measure(small_library.mesh(shot.cad), pose, shot.box, shot.mask).box_iou > 0.98
