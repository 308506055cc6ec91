"""Made-up photos, annotations and views for these tests."""

from __future__ import annotations

import hashlib
from typing import Any

import numpy as np

from cadpose.annotations.document import AnnotationDocument, Failure, document_from
from cadpose.geometry.boxes import Box
from cadpose.records import (
    Annotation,
    CadModel,
    Candidate,
    Detection,
    Mask,
    Photo,
    PhotoCamera,
    Pose4Dof,
    Pose6Dof,
    Refinement,
    Rotation,
    RotationHypothesis,
    Views,
)


def make_photo(name: str = "photos/street.jpg", width: int = 120, height: int = 80) -> Photo:
    y, x = np.mgrid[:height, :width]
    rgb = np.stack([x * 255 // width, y * 255 // height, (x + y) % 256], axis=-1).astype(np.uint8)
    return Photo(rgb, name, hashlib.sha256(name.encode(errors="replace")).hexdigest())


def make_cad(number: int = 0, **changes: Any) -> CadModel:
    values: dict[str, Any] = {
        "id": f"Set/cad-{number}.obj",
        "name": f"CAD {number}",
        "category": "car",
        "source": "Sweet Home 3D Set.sh3f",
        "licence": "CC-BY-3.0",
        "creator": "A. Maker",
        "size_cm": (170.5, 420.0, 150.25),
        "face_count": 1234,
        "sha256": "ab" * 32,
    }
    return CadModel(**(values | changes))


def make_mask(photo: Photo, box: Box) -> Mask:
    y, x = np.mgrid[: photo.height, : photo.width] + 0.5
    cx, cy = box.centre
    return np.asarray(((x - cx) / box.width * 2) ** 2 + ((y - cy) / box.height * 2) ** 2 < 1)


def make_annotation(photo: Photo, *, box: Box | None = None, **changes: Any) -> Annotation:
    box = box or Box(20.25, 10.5, 100.75, 70.0)
    rotation = Rotation(312.4, 8.1, -1.5)
    detection = Detection(
        box=box,
        category="car",
        score=0.875,
        mask=make_mask(photo, box),
        source="embedded",
        rotation=Rotation(311.0, 7.0),
        alternatives=(("bus", 0.1), ("van", 0.025)),
        truncated=True,
        unsure=True,
    )
    values: dict[str, Any] = {
        "photo_name": photo.name,
        "photo_sha256": photo.sha256,
        "photo_size": (photo.width, photo.height),
        "detection": detection,
        "pose": Pose4Dof(rotation, focal_px=2.0 * box.width, principal_px=box.centre),
        "candidates": tuple(
            Candidate(make_cad(i), 0.9 - i / 10, rotation, {"cosine": 0.9 - i / 10, "sm2": 1.0 / 3.0}, p)
            for i, p in enumerate((0.5, 0.125, 0.0625))
        ),
        "hypotheses": (
            RotationHypothesis(rotation, 0.71, 0.6, 24.5, True),
            RotationHypothesis(Rotation(132.4, 8.1), 0.5, 0.4),
        ),
        "box_iou": 0.93,
        "mask_iou": 0.81,
        "none_probability": 0.3125,
        "cad_needs_review": True,
        "refinement": Refinement(
            "fast", Pose4Dof(Rotation(310.0, 8.5), 1.9 * box.width, box.centre), 0.5, 0.625, 71, 3.5
        ),
        "pose_6dof": Pose6Dof.from_4dof(
            Pose4Dof(rotation, 2.0 * box.width, box.centre), PhotoCamera(150.0, (60.0, 40.0), "exif"), 4.75
        ),
        "confidence": 0.5625,
        "verdict": "review",
        "seconds": {"detection": 0.1, "rotation": 1 / 3},
        "provenance": {"cadpose": "0.1.0", "stages": ["embedded", "vote"], "seed": 0, "gpu": None},
    }
    return Annotation(**(values | changes))


def make_failure() -> Failure:
    return Failure(
        Detection(Box(1, 2, 30, 40), "zebra", 0.5, tiny=True), "the library has no zebra", "library"
    )


def make_document(name: str = "photos/street.jpg", annotations: int = 2) -> AnnotationDocument:
    photo = make_photo(name)
    boxes = [Box(5.0 + 7 * i, 4.0, 60.0 + 7 * i, 50.5) for i in range(annotations)]
    return document_from(photo, [make_annotation(photo, box=box) for box in boxes], [make_failure()])


def make_views(sizes: list[tuple[int, int]] | int, width: int, height: int) -> Views:
    """Views that show an ellipse of (width, height) pixels each; ``int`` for so many equal ones."""
    ellipses = [(width // 2, height // 2)] * sizes if isinstance(sizes, int) else sizes
    y, x = np.mgrid[:height, :width] + 0.5
    alpha = np.stack(
        [
            np.where(((x - width / 2) / w * 2) ** 2 + ((y - height / 2) / h * 2) ** 2 < 1, 255, 0)
            for w, h in ellipses
        ]
    ).astype(np.uint8)
    rgb = np.where(alpha[..., None] > 0, np.array([200, 40, 40], np.uint8), 0).astype(np.uint8)
    return Views(rgb, alpha, np.where(alpha > 0, 2.0, np.inf).astype(np.float32))
