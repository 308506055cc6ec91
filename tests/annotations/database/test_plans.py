"""SQLite finds rows as it was meant to: walking the whole store for a page is quick in small tests only."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from cadpose.annotations.store import Selection, Store
from tests.annotations.database.test_queue import fill


@pytest.fixture
def plans(tmp_path: Path) -> Iterator[tuple[Store, list[str]]]:
    """A store, and the plan of every question about annotations that it is asked."""
    told: list[str] = []

    def look(connection: Any, cursor: Any, statement: str, parameters: Any, *_: object) -> None:
        if statement.startswith("SELECT") and "FROM annotations" in statement:
            other = connection.connection.cursor()
            other.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
            told.append("; ".join(row[3] for row in other.fetchall()))

    with Store(f"sqlite:///{tmp_path / 'a.db'}") as store:
        fill(store)
        sa.event.listen(sa.Engine, "before_cursor_execute", look)
        yield store, told
        sa.event.remove(sa.Engine, "before_cursor_execute", look)


@pytest.mark.parametrize(
    ("selection", "index"),
    [
        (Selection(), "ix_annotations_queue"),
        (Selection(verdicts=("review",)), "ix_annotations_by_verdict"),
        (Selection(category="bus"), "ix_annotations_by_category_only"),
        (Selection(category="bus", verdicts=("review",)), "ix_annotations_by_category"),
        (Selection(cad_id="Set/cad-7.obj"), "ix_annotations_by_cad"),
        (Selection(min_confidence=0.5), "ix_annotations_queue"),
    ],
)
def test_a_page_is_read_from_its_index_in_order(
    plans: tuple[Store, list[str]], selection: Selection, index: str
) -> None:
    store, told = plans
    store.queue(selection, after="0.1:", limit=3)
    keys, shown = told
    assert f"USING COVERING INDEX {index} (in_force=?" in keys and "TEMP B-TREE" not in keys
    assert "sqlite_autoindex_annotations_1 (id=?)" in shown and "SCAN" not in shown


@pytest.mark.parametrize(
    "selection", [Selection(), Selection(category="bus", verdicts=("review",)), Selection(text="street")]
)
def test_a_stream_reads_annotations_by_their_photos(
    plans: tuple[Store, list[str]], selection: Selection
) -> None:
    store, told = plans
    assert len(list(store.iter_annotations(selection))) > 3
    assert len(list(store.iter_documents(rejected=False))) == 25
    assert len(told) >= 2
    for plan in told:
        assert "sqlite_autoindex_annotations_2 (photo_sha256=?)" in plan
        assert "ix_annotations_queue" not in plan.replace("USING COVERING INDEX ix_annotations_queue", "")
