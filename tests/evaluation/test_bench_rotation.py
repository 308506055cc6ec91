from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.evaluation.bench_rotation import bench_rotation
from cadpose.evaluation.bench_stages import STAND_IN_BOX, stand_in_photo
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator


def test_the_parts_of_an_estimate(small_library: Library, tmp_path: Path) -> None:
    annotator = Annotator(small_library, cache=tmp_path, candidates=2)
    told = bench_rotation(annotator, stand_in_photo(annotator), STAND_IN_BOX, 1)
    assert list(told) == ["encoder", "network", "templates", "whole"]
    assert all(ms > 0 for ms in told.values())


def test_another_estimator_is_refused(small_library: Library, tmp_path: Path) -> None:
    annotator = Annotator(small_library, cache=tmp_path, rotation="render-and-compare")
    with pytest.raises(ValueError, match="embedded estimator"):
        bench_rotation(annotator, stand_in_photo(annotator), STAND_IN_BOX, 1)
