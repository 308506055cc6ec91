"""An annotator without networks: the object's rotation and the ranking are made up, all else is real."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.annotations.store import Store
from cadpose.batch.outcome import PhotoOutcome, Task
from cadpose.batch.run import annotate_photos
from cadpose.batch.worker import PhotoWorker
from cadpose.errors import DependencyError
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


@dataclass(frozen=True)
class FakeJob:
    """A job with the fake annotator, whose photos may do anything to the worker that holds them.

    Attributes:
        library: Its folder.
        tricks: File name of a photo to what it does: ``"kill"`` and ``"exit"`` end the process, ``"hang"``
            never ends, ``"once"`` kills the first process that holds it, ``"late"`` ends it when all is
            written, ``"weights"`` says that weights are missing, ``"fail"`` raises.
        folder: Where ``"once"`` notes that it was done, and ``stillborn`` who died.
        store: URL of the store.
        stillborn: So many workers die before they are ready.
        seconds: How long a photo takes at least.
    """

    library: Path
    tricks: tuple[tuple[str, str], ...] = ()
    folder: Path = Path()
    store: str | None = None
    stillborn: int = 0
    seconds: float = 0.0

    def open(self) -> PhotoWorker:
        """A worker; the process dies instead where that was asked for."""
        for number in range(self.stillborn):
            try:
                (self.folder / f"stillborn-{number}").touch(exist_ok=False)
            except FileExistsError:
                continue
            os.kill(os.getpid(), signal.SIGKILL)
        annotator = fake_annotator(
            self.library, detector=_Tricky(dict(self.tricks), self.folder, self.seconds)
        )
        return _LateWorker(annotator, self.tricks, self.open_store())

    def open_store(self) -> Store | None:
        """The store alone."""
        return None if self.store is None else Store(self.store)


class _LateWorker(PhotoWorker):
    """May end before it can say that a photo is done."""

    def __init__(self, annotator: Annotator, tricks: Sequence[tuple[str, str]], store: Store | None) -> None:
        super().__init__(annotator, store=store)
        self.late = {name for name, trick in tricks if trick == "late"}

    def annotate(self, task: Task) -> PhotoOutcome:
        outcome = super().annotate(task)
        if task.photo.name in self.late:
            os._exit(3)
        return outcome


class _Tricky(FakeDetector):
    def __init__(self, tricks: dict[str, str], folder: Path, seconds: float) -> None:
        super().__init__()
        self.tricks, self.folder, self.seconds = tricks, folder, seconds

    def detect(self, photo: Photo) -> list[Detection]:
        time.sleep(self.seconds)
        name = Path(photo.name).name
        with (self.folder / "seen.txt").open("a") as seen:
            seen.write(f"{name} {os.getpid()}\n")
        trick = self.tricks.get(name)
        if trick == "once":
            try:
                (self.folder / f"once-{name}").touch(exist_ok=False)
            except FileExistsError:
                trick = None
        if trick in ("kill", "once"):
            os.kill(os.getpid(), signal.SIGKILL)
        elif trick == "exit":
            os._exit(3)
        elif trick == "hang":
            time.sleep(1000)
        elif trick == "weights":
            raise DependencyError("the weights are missing")
        elif trick == "fail":
            raise ValueError("odd")
        return super().detect(photo)
