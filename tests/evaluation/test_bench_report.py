from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cadpose.evaluation import bench_report
from cadpose.evaluation.bench_candidates import bench_candidates
from cadpose.evaluation.bench_compare import compare
from cadpose.evaluation.bench_floors import Floor, Machine, measure_floors, measure_machine, operations
from cadpose.evaluation.bench_galleries import bench_galleries
from cadpose.evaluation.bench_rendering import raster
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo
from cadpose.rendering import Renderer


class GivenBox:
    """Finds one object of the library's first category."""

    name = "given"

    def detect(self, photo: Photo) -> list[Detection]:
        return [Detection(box=Box(80, 0, 560, 480), category="chair", score=1.0, source="given")]


def annotator_of(library: Library, cache: Path) -> Annotator:
    return Annotator(library, cache=cache, candidates=2, detector=GivenBox())


def test_operations_of_a_known_network() -> None:
    one = operations(("lite0-head.onnx", (("stride32", (1, 192, 7, 7)),)))
    two = operations(("lite0-head.onnx", (("stride32", (2, 192, 7, 7)),)))
    assert one > 2.0 * 1280 * 1000
    assert two == pytest.approx(2.0 * one)
    # EfficientNet-Lite0 at 224 px is published with 407 million products, some outside of convolutions.
    trunk = operations(("lite0-trunk.onnx", (("images", (1, 224, 224, 3)),)))
    middle = operations(("lite0-middle.onnx", (("stride16", (1, 112, 14, 14)),)))
    assert one + trunk + middle == pytest.approx(2 * 407e6, rel=0.1)


def test_a_network_of_others_counts_nothing() -> None:
    assert operations(("theirs.onnx", ())) == 0.0


def test_a_floor_is_arithmetic_and_traffic() -> None:
    assert Floor(gflop=3.0, mbytes=50.0).ms(
        Machine(gflops=100.0, gflops_one_core=50.0, gbytes=10.0)
    ) == pytest.approx(35.0)


def test_the_machine_computes_and_copies() -> None:
    machine = measure_machine(repeats=1)
    assert machine.gflops > 0.1
    assert machine.gflops_one_core > 0.1
    assert machine.gbytes > 0.01


def test_floors_of_the_stages(small_library: Library, tmp_path: Path) -> None:
    annotator = annotator_of(small_library, tmp_path)
    floors = measure_floors(annotator, Photo(np.full((480, 640, 3), 170, np.uint8), "grey"))
    assert list(floors) == ["detect", "mask", "rotation", "similarity", "alignment"]
    assert floors["detect"].gflop == 0.0  # a given box needs no network
    assert min(floors[stage].gflop for stage in ("mask", "rotation", "similarity", "alignment")) > 0.1
    assert floors["rotation"].mbytes > 1.0


def test_no_floors_of_an_object_that_cannot_be_annotated(small_library: Library, tmp_path: Path) -> None:
    class Foreign(GivenBox):
        def detect(self, photo: Photo) -> list[Detection]:
            return [replace(one, category="airship") for one in super().detect(photo)]

    annotator = Annotator(small_library, cache=tmp_path, candidates=2, detector=Foreign())
    said: list[str] = []
    told = bench_report.bench(annotator, [], 1, parts=(), progress=said.append)
    assert told["floors"] == {}
    assert "airship" in said[0]


def test_no_floors_of_several_photos(small_library: Library, tmp_path: Path) -> None:
    grey = Photo(np.full((480, 640, 3), 170, np.uint8), "grey")
    assert (
        bench_report.bench(annotator_of(small_library, tmp_path), [grey, grey], 1, parts=())["floors"] == {}
    )


def test_candidates_are_timed_and_the_missing_are_told(small_library: Library, tmp_path: Path) -> None:
    def missing() -> Renderer:
        raise ImportError("not here")

    timed = bench_candidates(
        annotator_of(small_library, tmp_path), 1, {"one": (lambda: raster(1), True), "none": (missing, False)}
    )
    assert timed[0].ratio == 1.0
    assert (timed[1].ms, timed[1].skipped) == (None, "not here")


def test_galleries_are_made_anew(small_library: Library, tmp_path: Path) -> None:
    told = bench_galleries(annotator_of(small_library, tmp_path), 1)
    assert told.models == 1
    assert 0.0 < told.encoding < 1.0
    assert told.per_minute > 0.0
    with pytest.raises(ValueError, match="at least 1"):
        bench_galleries(annotator_of(small_library, tmp_path), 0)


def test_a_run_is_json_and_equals_itself(small_library: Library, tmp_path: Path) -> None:
    told = bench_report.bench(annotator_of(small_library, tmp_path), [], 1, parts=())
    assert json.loads(json.dumps(told)) == told
    assert {change.ratio for change in compare(told, told)} == {1.0}
