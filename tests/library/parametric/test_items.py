from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.importers import add_parametric
from cadpose.library.parametric import items as items_module
from cadpose.library.parametric.items import DEFAULT_COUNT, parametric_items
from cadpose.library.parametric.registry import GENERATORS, make


def test_ten_of_each_by_default() -> None:
    items = parametric_items()
    assert len(items) == DEFAULT_COUNT * len(GENERATORS)
    assert len({item.id for item in items}) == len(items)
    assert items[0].id == "parametric/" + min(GENERATORS) + "/000"
    assert {item.licence for item in items} == {"CC0-1.0"}


def test_counts_by_category() -> None:
    items = parametric_items(("sofa", "chair", "sofa"), {"chair": 2})
    assert [i.id for i in items if i.category == "chair"] == ["parametric/chair/000", "parametric/chair/001"]
    assert sum(i.category == "sofa" for i in items) == DEFAULT_COUNT


def test_wrong_demands_are_told() -> None:
    with pytest.raises(InputError, match=r"no parametric models of unicorn; there are of .*chair, "):
        parametric_items(("chair", "unicorn"))
    with pytest.raises(InputError, match="0 parametric models of chair"):
        parametric_items(("chair",), 0)


def test_adding_again_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    library = Library.create(tmp_path / "library")
    first = add_parametric(library, categories=("chair", "table"), limit=2)
    assert first.added == tuple(f"parametric/{c}/00{k}" for c in ("chair", "table") for k in (0, 1))
    assert first.failed == ()
    digest = library.digest
    again = add_parametric(library, categories=("chair", "table"), limit=2)
    assert again.unchanged == first.added and not again.added and not again.updated
    more = add_parametric(library, categories=("chair",), limit=3)
    assert more.added == ("parametric/chair/002",) and len(more.unchanged) == 2
    model = library.get("parametric/chair/001")
    assert (model.name, model.category, model.source) == ("Chair or stool 001", "chair", "parametric")
    stored, made = library.mesh(model), make("chair", 1)
    assert np.allclose(stored.vertices, made.vertices, atol=1e-6)
    assert stored.materials[0].rgba == pytest.approx(made.materials[0].rgba)
    assert library.digest != digest and library.check() == []
    # Other generators give other models.
    monkeypatch.setattr(items_module, "_fingerprint", lambda: "changed")
    assert add_parametric(library, categories=("table",), limit=2).updated == first.added[2:]


@pytest.mark.slow
def test_worker_processes_make_the_same(tmp_path: Path) -> None:
    one, two = (Library.create(tmp_path / name) for name in ("one", "two"))
    add_parametric(one, categories=("chair",), limit=5, workers=1)
    add_parametric(two, categories=("chair",), limit=5, workers=2)
    assert one.digest == two.digest
