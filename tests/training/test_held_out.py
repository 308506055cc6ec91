from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.sweethome3d import DEBIAN_FOLDER, sweethome3d_items
from cadpose.library.sweethome3d_exceptions import read_exceptions
from cadpose.training.held_out import (
    FEWEST,
    LEAST_MODELS,
    MOST,
    NEAR_DUPLICATE,
    choose,
    descriptors,
    lookalikes,
    near_duplicates,
    read_held_out,
    same_but_colour,
)
from cadpose.training.shapes import DATA, LEFT_OUT

CATEGORIES = json.loads((DATA / "held-out.json").read_text(encoding="utf-8"))["categories"]


def spread(count: int) -> NDArray[np.float32]:
    """Descriptors that are all far from each other."""
    return np.eye(count, dtype=np.float32)


def test_each_category_of_the_file_holds_out_about_a_fifth() -> None:
    assert {"car", "chair", "sofa", "bed", "table"} <= set(CATEGORIES)
    unfit = {e.id for e in read_exceptions() if e.problem == "unfit"}
    for category, entry in CATEGORIES.items():
        held = entry["held_out"]
        assert entry["models"] >= LEAST_MODELS, category
        assert FEWEST <= len(held) <= MOST, category
        assert held == sorted(set(held)) and not unfit & set(held)
        assert not set(entry["lookalikes"]) & set(held)
        assert read_held_out()[category] == {*held, *entry["lookalikes"]}


@pytest.mark.slow
@pytest.mark.skipif(not any(DEBIAN_FOLDER.glob("*.sh3f")), reason="needs sweethome3d-furniture")
def test_no_near_duplicate_of_a_held_out_model_is_trained_on(tmp_path: Path) -> None:
    unfit = {e.id for e in read_exceptions() if e.problem == "unfit"}
    items = [i for i in sweethome3d_items(DEBIAN_FOLDER) if i.id not in unfit]
    counts = {c: sum(i.category == c for i in items) for c in {i.category for i in items} - LEFT_OUT}
    assert {c for c, n in counts.items() if n >= LEAST_MODELS} == set(CATEGORIES)
    library = Library.create(tmp_path / "library")
    library.add(i for i in items if i.category in CATEGORIES)
    for category, held in read_held_out().items():
        models = library.models(category)
        rows = descriptors(library, models)
        assert choose([m.id for m in models], rows) == CATEGORIES[category]["held_out"]
        out = np.array([m.id in held for m in models])
        distances = np.linalg.norm(rows[out, None] - rows[None, ~out], axis=2)
        assert distances.min() > NEAR_DUPLICATE, category


def test_few_models_are_all_trained_on() -> None:
    assert choose([f"m{i}" for i in range(LEAST_MODELS - 1)], spread(LEAST_MODELS - 1)) == []


@pytest.mark.parametrize(("models", "held"), [(8, 2), (12, 2), (20, 4), (100, 6)])
def test_how_many_are_held_out(models: int, held: int) -> None:
    assert len(choose([f"m{i}" for i in range(models)], spread(models))) == held


def test_the_choice_does_not_depend_on_the_order() -> None:
    ids = [f"m{i}" for i in range(20)]
    order = np.random.default_rng(0).permutation(20)
    assert choose(ids, spread(20)) == choose([ids[i] for i in order], spread(20)[order])


def test_lookalikes_share_their_fate() -> None:
    ids = [f"m{i}" for i in range(20)]
    for seed in range(30):
        rows = spread(20)
        pairs = np.random.default_rng(seed).permutation(20).reshape(-1, 2)
        rows[pairs[:, 1]] = rows[pairs[:, 0]]
        held = set(choose(ids, rows))
        assert 4 <= len(held) <= 5
        assert all((ids[a] in held) == (ids[b] in held) for a, b in pairs)


def test_lookalikes_are_told_through_others_and_by_colour() -> None:
    rows = np.array([[0.0, 9], [5, 0], [0.14, 9], [0.28, 9], [9, 9], [7, 7]], dtype=np.float32)
    ids = ["a/one.obj", "b/two.obj", "c/three.obj", "d/four.obj", "e/sofa_red.obj", "f/white-sofa.obj"]
    assert sorted(sorted(g) for g in lookalikes(ids, rows)) == [[0, 2, 3], [1], [4, 5]]


def test_a_name_without_colour_says_nothing() -> None:
    assert same_but_colour("x/wooden_office_teak_table.obj") == same_but_colour(
        "y/wooden_office_pear_table.obj"
    )
    assert same_but_colour("x/chair.obj") == same_but_colour("x/blue.obj") == ""


def test_near_duplicates_are_found_among_the_others(small_library: Library) -> None:
    cars = [m.id for m in small_library.models("car")]
    rows = descriptors(small_library, small_library.models("car"))
    close = [i for i in cars[1:] if np.linalg.norm(rows[cars.index(i)] - rows[0]) <= NEAR_DUPLICATE]
    assert near_duplicates(small_library, "car", cars[:1]) == close
    assert near_duplicates(small_library, "car", cars) == near_duplicates(small_library, "car", []) == []


@pytest.mark.parametrize("text", ["", "[]", '{"categories": {"car": {}}}'])
def test_a_damaged_file_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "held.json"
    path.write_text(text)
    with pytest.raises(InputError, match="held-out"):
        read_held_out(path)
