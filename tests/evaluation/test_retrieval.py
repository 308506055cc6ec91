from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pytest

from cadpose.datasets.labels import Label
from cadpose.errors import CadposeError, LibraryError
from cadpose.evaluation.retrieval import RetrievalResult, evaluate_retrieval, retrieval_table


def label(cad: str, category: str = "car") -> Label:
    return Label(Path(f"{cad}.png"), category, None, cad)


def result(rank: int | None, category: str = "car") -> RetrievalResult:
    """The true model ``a`` at that rank of four, or not ranked."""
    others = ["b", "c", "d", "e"]
    if rank is not None:
        others.insert(rank - 1, "a")
    (made,) = evaluate_retrieval([label("a", category)], lambda _: others, CadposeError)
    assert made.rank == rank
    return made


def failed(category: str = "car") -> RetrievalResult:
    return RetrievalResult(label("a", category), (), None, "no")


def test_rank_is_the_place_of_the_true_model() -> None:
    found = evaluate_retrieval([label("a"), label("c"), label("z")], lambda _: ["a", "b", "c"], CadposeError)
    assert [r.rank for r in found] == [1, 3, None]
    assert found[0].ranking == ("a", "b", "c")
    assert not any(r.reason for r in found)


def test_recoverable_errors_fail_their_photo_only() -> None:
    done: list[RetrievalResult] = []

    def rank(one: Label) -> Sequence[str]:
        if one.cad == "b":
            raise LibraryError("no such model")
        return ["a"]

    found = evaluate_retrieval([label("a"), label("b"), label("a")], rank, CadposeError, done.append)
    assert done == found
    assert [r.reason for r in found] == ["", "no such model", ""]
    assert (found[1].ranking, found[1].rank) == ((), None)
    table = retrieval_table(found)
    assert (table["n"], table["top1"]) == (2, 1.0)
    assert table["yield"] == pytest.approx(2 / 3)


def test_other_errors_are_not_hidden() -> None:
    def broken(_: Label) -> Sequence[str]:
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        evaluate_retrieval([label("a")], broken, CadposeError)


def test_the_table_by_hand() -> None:
    cars = [result(1), result(1), result(2), result(3), result(4), result(None), failed(), failed()]
    chairs = [result(1, "chair"), result(2, "chair")]
    table = retrieval_table(cars + chairs)
    car, chair = table["classes"]["car"], table["classes"]["chair"]
    assert (car["n"], car["yield"]) == (6, 0.75)
    assert [car[f"top{k}"] for k in (1, 2, 3)] == pytest.approx([2 / 6, 3 / 6, 4 / 6])
    assert [chair[f"top{k}"] for k in (1, 2, 3)] == [0.5, 1.0, 1.0]
    assert (table["n"], table["yield"]) == (8, 0.8)
    assert [table[f"top{k}"] for k in (1, 2, 3)] == pytest.approx([3 / 8, 5 / 8, 6 / 8])
    assert table["macro"] == pytest.approx({"top1": 5 / 12, "top2": 0.75, "top3": 5 / 6})
    # Newcombe's method 3 for 3 of 8.
    assert table["top1_interval"] == pytest.approx([0.1368, 0.6943], abs=5e-4)
    assert table["top1_interval"][1] < table["top3_interval"][1]


def test_keys_are_the_published_ones() -> None:
    keys = {"top1", "top2", "top3", "n", "yield"}
    table = retrieval_table([result(1), failed()])
    assert keys <= set(table)
    assert keys <= set(table["classes"]["car"])
    assert json.loads(json.dumps(table, allow_nan=False)) == table


@pytest.mark.parametrize("results", [[], [failed()]])
def test_no_answer_at_all_gives_a_valid_table(results: list[RetrievalResult]) -> None:
    table = retrieval_table(results)
    assert (table["n"], table["yield"], table["top1"], table["top3"]) == (0, 0.0, None, None)
    assert table["top1_interval"] is None
    assert table["macro"] == {}
    json.dumps(table, allow_nan=False)
