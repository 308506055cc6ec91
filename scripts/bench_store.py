"""How fast a store of many annotations is: fills one with made-up documents, then times what is asked of it.

    python scripts/bench_store.py --annotations 100000 --store sqlite:////tmp/bench.db
    python scripts/bench_store.py --annotations 100000 --store postgresql+psycopg://user@host/database

The figures of docs/database.md come from here. A store that holds some of them already is filled up.
"""

from __future__ import annotations

import argparse
import hashlib
import resource
import statistics
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import SCHEMA, AnnotationDocument, FailurePart
from cadpose.annotations.parts import PhotoPart, PosePart
from cadpose.annotations.store import Author, Selection, Store
from cadpose.geometry.boxes import Box
from cadpose.records import (
    Annotation,
    CadModel,
    Candidate,
    Detection,
    Photo,
    Pose4Dof,
    Rotation,
    RotationHypothesis,
    Verdict,
)

CATEGORIES = ("car", "chair", "sofa", "bed", "table", "bicycle", "bus", "bookcase")
LICENCES = ("CC-BY-3.0", "CC-BY-4.0", "CC0-1.0", "LGPL-2.1", "FAL-1.3")
WIDTH, HEIGHT = 320, 240


def cads(rng: np.random.Generator) -> list[CadModel]:
    return [
        CadModel(
            id=f"Set/{category}-{i}.obj",
            name=f"{category} {i}",
            category=category,
            source="Sweet Home 3D Set.sh3f",
            licence=str(rng.choice(LICENCES)),
            creator=f"Maker {i % 17}",
            size_cm=(float(rng.uniform(30, 200)), float(rng.uniform(30, 400)), float(rng.uniform(30, 200))),
            face_count=int(rng.integers(100, 20000)),
            sha256=hashlib.sha256(f"{category}{i}".encode()).hexdigest(),
        )
        for category in CATEGORIES
        for i in range(100)
    ]


def detection(rng: np.random.Generator, category: str) -> Detection:
    width, height = rng.uniform(30, 180), rng.uniform(30, 140)
    x, y = rng.uniform(0, WIDTH - width), rng.uniform(0, HEIGHT - height)
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    mask = ((columns - x - width / 2) / width) ** 2 + ((rows - y - height / 2) / height) ** 2 < 0.25
    box = Box(float(x), float(y), float(x + width), float(y + height))
    return Detection(box, category, float(rng.uniform(0.3, 1)), mask, "embedded")


def rotation(rng: np.random.Generator) -> Rotation:
    return Rotation(float(rng.uniform(0, 360)), float(rng.uniform(-10, 40)), float(rng.normal(0, 3)))


def verdict_of(confidence: float) -> Verdict:
    return "auto_accept" if confidence > 0.8 else "review" if confidence > 0.3 else "reject"


def annotation(
    rng: np.random.Generator, photo: Photo, found: Detection, models: list[CadModel]
) -> Annotation:
    own = [m for m in models if m.category == found.category]
    chosen = rng.choice(len(own), 10, replace=False)
    turns = [rotation(rng) for _ in range(3)]
    confidence = float(rng.beta(4, 2))
    return Annotation(
        photo_name=photo.name,
        photo_sha256=photo.sha256,
        photo_size=(photo.width, photo.height),
        detection=found,
        pose=Pose4Dof(turns[0], float(rng.uniform(100, 900)), found.box.centre),
        candidates=tuple(
            Candidate(
                own[i],
                float(0.9 - rank / 20),
                turns[0],
                {"cosine": float(rng.random()), "sm1": float(rng.random()), "sm2": float(rng.random())},
                float(0.3 / (rank + 1)),
            )
            for rank, i in enumerate(chosen)
        ),
        hypotheses=tuple(
            RotationHypothesis(turn, float(0.9 - rank / 10), float(0.6 / (rank + 1)), 20.0, rank > 0)
            for rank, turn in enumerate(turns)
        ),
        box_iou=float(rng.uniform(0.7, 1)),
        mask_iou=float(rng.uniform(0.5, 1)),
        seconds={"detection": 0.1, "rotation": 0.05, "ranking": 0.2},
        provenance={"cadpose": "0.1.0", "library": "a" * 64, "detector": "embedded", "seed": 0},
        none_probability=0.1,
        confidence=confidence,
        verdict=verdict_of(confidence),
    )


class Maker:
    """Documents of one to four objects, about one in fifty of which was left out.

    Objects are drawn from a pool of some hundred, each time with another pose, confidence and verdict.
    """

    def __init__(self, number: int, seed: int) -> None:
        self._number, self._seed, self.seconds = number, seed, 0.0
        self._rng = np.random.default_rng(seed)

    def _pool(self, number: int) -> list[AnnotationPart]:
        photo, models = Photo(np.zeros((HEIGHT, WIDTH, 3), np.uint8)), cads(self._rng)
        found = [detection(self._rng, str(self._rng.choice(CATEGORIES))) for _ in range(number)]
        return [AnnotationPart.of(annotation(self._rng, photo, f, models)) for f in found]

    def _another(self, part: AnnotationPart) -> AnnotationPart:
        rng = self._rng
        pose = Pose4Dof(rotation(rng), float(rng.uniform(100, 900)), part.pose.principal_px)
        confidence = float(rng.beta(4, 2))
        changes = {
            "pose": PosePart.of_pose(pose),
            "confidence": confidence,
            "verdict": verdict_of(confidence),
        }
        return part.model_copy(update=changes)

    def __iter__(self) -> Iterator[AnnotationDocument]:
        rng, made, photos = self._rng, 0, 0
        start = time.perf_counter()
        pool = self._pool(500)
        failure = FailurePart(detection=pool[0].detection, reason="the library has no zebra", stage="library")
        while made < self._number:
            name = f"run {self._seed} {photos // 1000:03}/{rng.choice(CATEGORIES)} {photos:06}.jpg"
            sha256 = hashlib.sha256(name.encode()).hexdigest()
            objects = min(int(rng.integers(1, 5)), self._number - made)
            document = AnnotationDocument(
                schema=SCHEMA,
                photo=PhotoPart(name=name, sha256=sha256, size=(WIDTH, HEIGHT)),
                annotations=tuple(self._another(pool[i]) for i in rng.integers(len(pool), size=objects)),
                failures=(failure,) if rng.random() < 0.02 else (),
            )
            made, photos = made + objects, photos + 1
            self.seconds += time.perf_counter() - start
            yield document
            start = time.perf_counter()


def milliseconds(ask: Callable[[], object], times: int = 15) -> str:
    """Median of several runs after one that warms up, and this process's own work of it."""
    ask()
    wall, own = [], []
    for _ in range(times):
        start, begun = time.perf_counter(), time.process_time()
        ask()
        wall.append(1000 * (time.perf_counter() - start))
        own.append(1000 * (time.process_time() - begun))
    return f"{statistics.median(wall):.1f} ms, {statistics.median(own):.1f} of computing"


def peak() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def tell(what: str, figure: str) -> None:
    print(f"{what:<46} {figure}", flush=True)


def fill(store: Store, number: int, seed: int) -> None:
    maker = Maker(number, seed)
    start = time.perf_counter()
    store.add_many(maker)
    spent = time.perf_counter() - start - maker.seconds
    tell("fill, without making the documents", f"{number / spent:.0f} annotations a second")


def stream(what: str, items: Iterator[object], most: int | None) -> None:
    before, start, begun = peak(), time.perf_counter(), time.process_time()
    number = sum(1 for _ in islice(items, most))
    spent, own = time.perf_counter() - start, time.process_time() - begun
    rate = f"{number / spent:.0f} a second, {number / own:.0f} a second of computing"
    tell(f"stream {number} {what}s", f"{rate}, +{peak() - before:.0f} MB")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--annotations", type=int, default=100_000)
    parser.add_argument("--store", default="sqlite:///runs/bench-store.db")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--stream", type=int, help="stream so many at most, instead of everything")
    parser.add_argument("--check", action="store_true", help="also time the check, which takes minutes")
    told = parser.parse_args()
    with Store(told.store) as store:
        tell("peak memory before", f"{peak():.0f} MB")
        missing = told.annotations - store.count()
        if missing > 0:
            fill(store, missing, told.seed + len(store.photos()))
        both = Selection(category="chair", verdicts=("review",))
        some = store.queue(limit=1).items[0]
        names = {"first page of 50": Selection(), "first page, category": Selection(category="chair")}
        names |= {
            "first page, category and verdict": both,
            "first page, verdict": Selection(verdicts=("review",)),
        }
        names |= {"first page, CAD model": Selection(cad_id=some.cad_id)}
        names |= {"first page, confidence 0.7 to 0.75": Selection(min_confidence=0.7, max_confidence=0.75)}
        names |= {"first page, two verdicts": Selection(verdicts=("review", "undecided"))}
        names |= {"first page, text of many names": Selection(text="chair")}
        names |= {"first page, text of one name": Selection(text="sofa 000007")}
        for name, selection in names.items():
            tell(name, milliseconds(partial(store.queue, selection)))
        tell("deep page (confidence 0.95)", milliseconds(lambda: store.queue(after="0.95:")))
        tell("deep page, category and verdict", milliseconds(lambda: store.queue(both, after="0.75:")))
        tell("count all", milliseconds(store.count))
        tell("count, category and verdict", milliseconds(lambda: store.count(both)))
        tell("one document", milliseconds(lambda: store.document(some.photo_sha256)))
        tell("one annotation", milliseconds(lambda: store.stored(some.annotation_id)))
        author = Author("bench")
        tell(
            "one decision",
            milliseconds(lambda: store.decide(some.annotation_id, "review", author, expected_version=None)),
        )
        tell("stats", milliseconds(store.stats, 1))
        stream("annotation", store.iter_annotations(), told.stream)
        stream("filtered annotation", store.iter_annotations(both), told.stream)
        stream("document", store.iter_documents(), told.stream)
        if told.check:
            start = time.perf_counter()
            problems = sum(1 for _ in store.check())
            tell("check", f"{time.perf_counter() - start:.0f} s, {problems} problems")
        tell("annotations", str(store.count()))
        tell("peak memory", f"{peak():.0f} MB")
    if told.store.startswith("sqlite:///"):
        tell("file", f"{Path(told.store.removeprefix('sqlite:///')).stat().st_size / 2**20:.0f} MB")


if __name__ == "__main__":
    main()
