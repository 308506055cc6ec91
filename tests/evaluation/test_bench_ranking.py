from __future__ import annotations

from pathlib import Path

from cadpose.evaluation.bench_ranking import bench_ranking
from cadpose.evaluation.bench_stages import STAND_IN_BOX, stand_in_photo
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator


def test_the_parts_of_a_ranking(small_library: Library, tmp_path: Path) -> None:
    annotator = Annotator(small_library, cache=tmp_path, candidates=2)
    told = bench_ranking(annotator, stand_in_photo(annotator), STAND_IN_BOX, 1)
    assert list(told) == ["cached views", "drawn", "whole"]
    assert all(ms > 0 for ms in told.values())
