from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.datasets.labels import Label
from cadpose.errors import InputError, LibraryError
from cadpose.evaluation.pool import label_pool
from cadpose.library.catalogue import Library


def test_the_labelled_model_votes_or_does_not(small_library: Library) -> None:
    cars = [m for m in small_library.models() if m.category == "car"]
    assert len(cars) >= 3
    for true in cars:
        label = Label(Path("a.png"), "car", cad=true.id, azimuth=0.0)
        assert label_pool(small_library, "usual", 2)(label) is None
        among = label_pool(small_library, "with-true", 2)(label)
        assert among is not None and len(among) == len(set(among)) == 2 and true in among
        without = label_pool(small_library, "without-true", 2)(label)
        assert without is not None and len(without) == len(set(without)) == 2 and true not in without


def test_what_is_missing_is_told(small_library: Library) -> None:
    with pytest.raises(InputError, match="names no CAD model"):
        label_pool(small_library, "with-true", 3)(Label(Path("a.png"), "car", azimuth=0.0))
    with pytest.raises(LibraryError, match="no CAD model 'x'"):
        label_pool(small_library, "with-true", 3)(Label(Path("a.png"), "car", cad="x", azimuth=0.0))
    chair = next(m.id for m in small_library.models() if m.category == "chair")
    with pytest.raises(InputError, match="a car by its label"):
        label_pool(small_library, "with-true", 3)(Label(Path("a.png"), "car", cad=chair, azimuth=0.0))


def test_a_model_without_others(small_library: Library, tmp_path: Path) -> None:
    chairs = [m for m in small_library.models() if m.category == "chair"]
    label = Label(Path("a.png"), "chair", cad=chairs[0].id, azimuth=0.0)
    pool = label_pool(small_library, "without-true", 3)
    if len(chairs) == 1:
        with pytest.raises(LibraryError, match="no chair beside"):
            pool(label)
    else:
        assert pool(label) == tuple(m for m in small_library.representatives("chair", 4) if m != chairs[0])
