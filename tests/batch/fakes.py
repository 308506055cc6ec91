"""An annotator without networks: the object's rotation and the ranking are made up, all else is real."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.batch.run import PhotoOutcome, annotate_photos
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import CadModel, Detection, Mask, Photo, Rotation, RotationHypothesis, Views
from tests.small_library import save


class FakeDetector:
    """A chair in the middle of every photo; a lamp too, which the library has no model of, if asked for."""

    name = "fake"

    def __init__(self, *, lamp: bool = False) -> None:
        self.lamp = lamp
        self.seen: list[str] = []

    def detect(self, photo: Photo) -> list[Detection]:
        self.seen.append(photo.name)
        box = Box(0.2 * photo.width, 0.2 * photo.height, 0.8 * photo.width, 0.8 * photo.height)
        lamps = [Detection(Box(0, 0, 9, 12), "lamp", 0.4)] if self.lamp else []
        return [Detection(box, "chair", 0.9), *lamps]


class FakeMasks:
    """The whole box."""

    name = "fake"

    def mask(self, photo: Photo, box: Box) -> Mask:
        mask = np.zeros((photo.height, photo.width), np.bool_)
        mask[int(box.y0) : int(box.y1) + 1, int(box.x0) : int(box.x1) + 1] = True
        return mask


class FakeRotation:
    """Always the same."""

    name = "fake"

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> list[RotationHypothesis]:
        return [RotationHypothesis(Rotation(35, 12), 1.0, 1.0)]


class FakeSimilarity:
    """The last candidate is the best."""

    name = "fake"

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> NDArray[np.float64]:
        return np.arange(float(len(views)))


def fake_annotator(library: Library | Path, **changes: Any) -> Annotator:
    stages: dict[str, Any] = {
        "detector": FakeDetector(),
        "masks": FakeMasks(),
        "rotation": FakeRotation(),
        "similarity": FakeSimilarity(),
    }
    return Annotator(library, **(stages | changes))


def picture(path: Path, seed: int = 0) -> Path:
    """A small grey photo."""
    return save(path, np.full((60, 80, 3), 40 + 2 * seed, np.uint8))


def files(folder: Path) -> dict[str, bytes]:
    """Every file below a folder."""
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def annotate_all(annotator: Annotator, photos: list[Path], out: Path, **kwargs: object) -> list[PhotoOutcome]:
    return list(annotate_photos(annotator, photos, out, **kwargs))  # type: ignore[arg-type]
