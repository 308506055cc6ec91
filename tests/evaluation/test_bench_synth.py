from __future__ import annotations

import cv2
import pytest

from cadpose.evaluation.bench_synth import bench_synth
from cadpose.library.catalogue import Library


def test_photos_are_drawn_and_written(small_library: Library) -> None:
    threads = cv2.getNumThreads()
    timing = bench_synth(small_library, photos=12, size=64)
    assert (timing.size, timing.photos, timing.models) == (64, 12, 5)
    assert timing.drawing > 5 and timing.writing > 5
    assert cv2.getNumThreads() == threads


def test_at_least_one_photo(small_library: Library) -> None:
    with pytest.raises(ValueError, match="at least 1"):
        bench_synth(small_library, photos=0)
