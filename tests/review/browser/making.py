"""A store of many annotations of made-up photos, and a small library of real models, for the page's tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.store import Store
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Annotation, Candidate, Detection, RotationHypothesis
from tests.small_library import Shot, shoot

#: How far the first annotation of each photo is turned away from the truth, degrees.
TURNED = 40.0


def make_store(
    folder: Path, library: Library, photos: int, each: int = 1, size: tuple[int, int] = (640, 480)
) -> str:
    """Photos of single cars under ``folder/photos`` and a store of ``each`` annotations of every one.

    The first annotation of a photo is turned by 40° in azimuth, and the least sure of it.

    Returns:
        The store's URL.
    """
    rng = np.random.default_rng(7)
    ids = [model.id for model in library.models("car")]
    (folder / "photos").mkdir(parents=True)
    url = f"sqlite:///{folder / 'store.db'}"
    with Store(url) as store:
        documents = (
            _photo(folder / "photos", library, ids, number, each, size, rng) for number in range(photos)
        )
        store.add_many(documents)
    return url


def _photo(
    folder: Path,
    library: Library,
    ids: list[str],
    number: int,
    each: int,
    size: tuple[int, int],
    rng: np.random.Generator,
) -> AnnotationDocument:
    width, height = size
    rotation = Rotation(float(rng.uniform(0, 360)), float(rng.uniform(5, 25)), float(rng.uniform(-3, 3)))
    name = f"street_{number:04d}.jpg"
    shot = shoot(
        library,
        ids[number % len(ids)],
        rotation,
        size=size,
        middle=(width * float(rng.uniform(0.4, 0.6)), height * float(rng.uniform(0.4, 0.6))),
        focal_px=width * float(rng.uniform(0.9, 1.1)),
        name=name,
    )
    Image.fromarray(shot.photo.rgb).save(folder / name, quality=88)
    photo = replace(read_photo(folder / name), name=name)
    shot = replace(shot, photo=photo)
    turns = [TURNED, *rng.uniform(-20, 20, each - 1)]
    annotations = [
        _annotation(shot, library, ids, float(turn), place, number) for place, turn in enumerate(turns)
    ]
    return document_from(photo, annotations)


def _annotation(
    shot: Shot, library: Library, ids: list[str], turn: float, place: int, number: int
) -> Annotation:
    true = shot.rotation
    rotation = Rotation((true.azimuth + turn) % 360.0, true.elevation, true.inplane)
    middle = shot.box.centre
    confidence = min(0.99, 0.05 + 0.18 * place + 0.0001 * number)
    return Annotation(
        photo_name=shot.photo.name,
        photo_sha256=shot.photo.sha256,
        photo_size=(shot.photo.width, shot.photo.height),
        detection=Detection(shot.box, "car", 0.9, shot.mask, source="made"),
        pose=Pose4Dof(rotation, shot.focal_px, middle),
        candidates=tuple(
            Candidate(library.get(key), 0.9 - 0.1 * rank, rotation, {}, 0.6 / (rank + 1))
            for rank, key in enumerate([shot.cad.id, *(other for other in ids if other != shot.cad.id)])
        ),
        hypotheses=(
            RotationHypothesis(rotation, 0.7, 0.6),
            RotationHypothesis(Rotation(true.azimuth, true.elevation, true.inplane), 0.6, 0.3),
        ),
        box_iou=0.8,
        mask_iou=0.7,
        confidence=confidence,
        verdict="review",
        provenance={"cadpose": "test"},
    )
