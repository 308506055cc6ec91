from __future__ import annotations

import sqlite3
from collections.abc import Mapping
from pathlib import Path

import pytest

from cadpose.errors import InputError
from cadpose.library.catalogue import INDEX, Library
from cadpose.library.sweethome3d_exceptions import ModelException
from cadpose.training.lite import sources as module
from cadpose.training.lite.sources import UNSEEN_SEED, drawn_options, sources


def test_weights() -> None:
    told = drawn_options({"airplane": 9, "car": 100, "chair": 900, "guitar": 400, "table": 4})
    assert told.weights == {"airplane": 3, "car": 75, "chair": 50, "guitar": 12, "table": 32}


def hold_out(patch: pytest.MonkeyPatch, shown: set[str], more: set[str]) -> None:
    def read(lookalikes: bool = True) -> Mapping[str, frozenset[str]]:
        return {"car": frozenset(shown | more if lookalikes else shown)}

    patch.setattr(module, "read_held_out", read)


def test_held_out_models_and_their_lookalikes_are_never_drawn(
    small_library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    ids = {m.id.rsplit("/", 1)[-1]: m.id for m in small_library.models()}
    plain = sources(small_library, None, 5)
    assert set(plain.train.models) == set(ids.values()) and plain.unseen is None
    assert plain.train.categories == ("car", "chair") and plain.train.seed == 5
    assert plain.train.options.size == 256 and plain.train.options.weights == {"car": 75, "chair": 50}

    hold_out(monkeypatch, {ids["hatch.obj"]}, {ids["throne.glb"]})
    told = sources(small_library, None)
    assert told.unseen is not None and told.unseen.models == (ids["hatch.obj"],)
    assert told.unseen.seed == UNSEEN_SEED and told.unseen.categories == told.train.categories
    assert set(told.train.models) == set(ids.values()) - {ids["hatch.obj"], ids["throne.glb"]}
    assert told.to_json()["drawn"]["models"] != plain.to_json()["drawn"]["models"]

    # A copy under another id is no other shape.
    monkeypatch.setattr(module, "near_duplicates", lambda lib, category, held: [ids["van.glb"]])
    assert ids["van.glb"] not in sources(small_library, None).train.models


def test_models_known_to_be_wrong_are_left_out(
    small_library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    van, plain, throne = (
        next(m.id for m in small_library.models() if m.id.endswith(name))
        for name in ("van.glb", "plain.obj", "throne.glb")
    )
    table = (
        ModelException(van, "unfit", "two vans"),
        ModelException(plain, "category", "chair"),  # put right already
        ModelException(throne, "category", "sofa"),
    )
    monkeypatch.setattr(module, "read_exceptions", lambda: table)
    told = sources(small_library, None)
    assert {i for i in (van, plain, throne) if i in told.train.models} == {plain}


def test_what_cannot_be_drawn_is_told(small_library: Library, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no folder"):
        sources(small_library, tmp_path / "none")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="empty"):
        sources(small_library, tmp_path / "empty")
    trees = Library.create(tmp_path / "trees")
    with sqlite3.connect(small_library.path / INDEX) as db:
        rows = db.execute("SELECT * FROM models").fetchall()
        names = [c[1] for c in db.execute("PRAGMA table_info(models)")]
    at = names.index("category")
    with sqlite3.connect(trees.path / INDEX) as db:
        told = [(*row[:at], "tree", *row[at + 1 :]) for row in rows]
        db.executemany(f"INSERT INTO models VALUES ({', '.join('?' * len(names))})", told)
    with pytest.raises(InputError, match="no model to train on"):
        sources(Library.open(trees.path), None)
