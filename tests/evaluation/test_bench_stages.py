from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import cast

import numpy as np
import pytest

from cadpose.errors import LibraryError
from cadpose.evaluation import bench_stages as bench_stages_module
from cadpose.evaluation.bench_stages import bench_meshes, bench_stages, stand_in_photo
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo, Rotation
from tests.library.builders import obj_box


@dataclass
class Run:
    seconds: dict[str, float]


@dataclass
class Clocked:
    """An annotator whose runs take what is told."""

    seconds: list[dict[str, float]]
    photos: list[str] = field(default_factory=list)

    def run(self, photo: Photo) -> Run:
        self.photos.append(photo.name)
        return Run(self.seconds[len(self.photos) - 1])


def photo(name: str) -> Photo:
    return Photo(np.zeros((4, 4, 3), np.uint8), name)


def test_median_milliseconds_without_the_first_run() -> None:
    runs = [
        {"read": 9.0, "detect": 9.0, "rotation": 9.0},
        {"read": 0.1, "detect": 0.010, "rotation": 0.100},
        {"read": 0.1, "detect": 0.030, "rotation": 0.300},
        {"read": 0.1, "detect": 0.020, "rotation": 0.200},
        {"read": 9.0, "detect": 9.0},
        {"read": 0.1, "detect": 0.040},
        {"read": 0.1, "detect": 0.050},
        {"read": 0.1, "detect": 0.060},
    ]
    clocked = Clocked(runs)
    told = bench_stages(cast(Annotator, clocked), [photo("a"), photo("b")], repeats=3)
    assert clocked.photos == ["a"] * 4 + ["b"] * 4
    # Reading a decoded photo is no stage; the rotation ran on one of the two photos only.
    assert told == pytest.approx({"detect": 35.0, "rotation": 200.0})


def test_meshes_are_those_of_a_fit_size(spheres: Library) -> None:
    meshes = bench_meshes(spheres)
    faces = [len(mesh.faces) for mesh in meshes.values()]
    # 320 and 12 faces are too few to time.
    assert sorted(faces) == [1280, 5120, 20480]
    for name, mesh in meshes.items():
        assert f"({len(mesh.faces)} faces)" in name


def test_huge_meshes_are_left_out(spheres: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench_stages_module, "_LARGEST", 6_000)
    assert sorted(len(mesh.faces) for mesh in bench_meshes(spheres).values()) == [1280, 5120]


def test_a_library_of_small_models_cannot_be_timed(tmp_path: Path) -> None:
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "chair.obj").write_text(obj_box(1, 2, 1))
    library = Library.create(tmp_path / "library")
    add_path(library, tmp_path / "source")
    with pytest.raises(LibraryError, match="no model of 1000 to 125000 faces"):
        bench_meshes(library)


class NoDetector:
    name = "none"

    def detect(self, photo: Photo) -> list[Detection]:
        return []


def test_the_stand_in_shows_a_model_on_grey(spheres: Library, tmp_path: Path) -> None:
    annotator = Annotator(spheres, detector=NoDetector(), cache=tmp_path)
    picture = stand_in_photo(annotator)
    assert picture.rgb.shape == (480, 640, 3)
    drawn = (picture.rgb != 170).any(axis=2)
    box = Box.from_mask(drawn)
    assert box.centre == pytest.approx((320.0, 240.0), abs=2.0)
    assert max(box.width, box.height) == pytest.approx(480 * 0.8, abs=2.0)


def test_stages_of_a_real_annotator(spheres: Library, tmp_path: Path) -> None:
    annotator = Annotator(spheres, detector=NoDetector(), candidates=1, cache=tmp_path)
    given = Detection(Box(100, 50, 500, 430), "chair", rotation=Rotation(30.0, 10.0))
    picture = stand_in_photo(annotator)
    assert set(bench_stages(annotator, [picture], 1)) == {"detect"}

    class OneChair(NoDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            return [given]

    told = bench_stages(Annotator(spheres, detector=OneChair(), candidates=1, cache=tmp_path), [picture], 1)
    assert {"detect", "mask", "rotation", "similarity", "alignment"} <= set(told)
    assert "read" not in told
    assert all(0.0 < ms < 60_000.0 for ms in told.values())
