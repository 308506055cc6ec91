"""From outcomes to tables, by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from cadpose.errors import InputError
from cadpose.evaluation.rank_counts import RankCounts
from cadpose.evaluation.retrieval import Outcome
from cadpose.evaluation.retrieval_summary import measure_table, retrieval_tables
from cadpose.evaluation.retrieval_tables import Rejected
from tests.evaluation.retrieving import outcome, rejected

# Cars: the true model is a, a, a, b; chairs: d, d.
OUTCOMES = [
    outcome(1), outcome(1), outcome(4), outcome(2, cad="b"),
    rejected(), rejected(), rejected("pose", "no rotation"),
    outcome(3, "chair", cad="d"), outcome(1, "chair", cad="d"),
]  # fmt: skip


def tables(outcomes: list[Outcome], **more: object) -> object:
    return retrieval_tables(outcomes, ["one"], dataset="x", rotation="true", boxes="true", **more)  # type: ignore[arg-type]


def test_counts_a_category_and_in_all() -> None:
    table = measure_table(OUTCOMES, "one")
    assert table.rows == (RankCounts("car", 7, 4, 2, 1, 0), RankCounts("chair", 2, 2, 1, 0, 1))
    assert table.total == RankCounts("all", 9, 6, 3, 1, 1)
    assert table.rejected == (
        Rejected("detection", "nothing found", 2), Rejected("pose", "no rotation", 1),
    )  # fmt: skip


def test_means_over_categories_and_over_true_models() -> None:
    categories, models = measure_table(OUTCOMES, "one").means
    assert (categories.name, models.name) == ("macro mean of categories", "macro mean of true models")
    assert (categories.first, categories.second, categories.third) == pytest.approx((1 / 2, 1 / 8, 1 / 4))
    # a: 2 of 3 first; b: second; d: first and third.
    assert (models.first, models.second, models.third) == pytest.approx((7 / 18, 1 / 3, 1 / 6))


def test_chance_and_the_most_frequent_models() -> None:
    chance, frequent = measure_table(OUTCOMES, "one").baselines
    assert (chance.first, chance.second, chance.third) == pytest.approx((0.2, 0.2, 0.2))
    # Cars: a is true in 3 of 4, b in 1; chairs: d in both.
    assert (frequent.first, frequent.second, frequent.third) == pytest.approx((5 / 6, 1 / 6, 0.0))


def test_baselines_where_the_true_model_is_missing_or_candidates_are_few() -> None:
    missing = outcome(None)
    assert missing.place("one") is None
    two = replace(outcome(1), candidates=("a", "b"))
    chance, frequent = measure_table([missing, two], "one").baselines
    assert (chance.first, chance.second, chance.third) == pytest.approx((0.25, 0.25, 0.0))
    assert (frequent.first, frequent.top3) == (0.5, 0.5)
    (note,) = retrieval_tables([missing, two], ["one"], dataset="x", rotation="", boxes="").notes
    assert note.startswith("1 photos whose true model is not among the candidates")


def test_accepted_photos_and_how_sure_the_measure_is() -> None:
    outcomes = [
        outcome(1, probability=0.95), outcome(2, probability=0.95), outcome(1, probability=0.5),
        outcome(1, probability=0.5, needs_review=False), outcome(1, probability=0.99, needs_review=True),
        rejected(),
    ]  # fmt: skip
    table = measure_table(outcomes, "one", accept=0.9)
    assert (table.total.accepted, table.total.accepted_right) == (3, 2)
    assert table.certainty is not None and table.certainty.threshold == 0.9
    brier = (0.05**2 + 0.95**2 + 2 * 0.5**2 + 0.01**2) / 5
    assert table.certainty.brier == pytest.approx(brier)
    assert measure_table(outcomes, "one", accept=0.4).total.accepted == 4
    plain = measure_table(OUTCOMES, "one")
    assert plain.certainty is None and plain.total.accepted is None


def test_nothing_answered() -> None:
    table = measure_table([rejected()], "one")
    assert table.total == RankCounts("all", 1, 0, 0, 0, 0)
    assert (table.means, table.baselines, table.certainty) == ((), (), None)


def test_real_and_synthetic_photos_never_share_a_table() -> None:
    drawn = replace(outcome(1), label=replace(outcome(1).label, synthetic=True))
    with pytest.raises(InputError, match="x: holds 1 synthetic and 1 real photos"):
        tables([drawn, outcome(1)])
    one = retrieval_tables([drawn], ["one"], dataset="x", rotation="", boxes="", drawn_with="Blender")
    assert one.title == "CAD retrieval, SYNTHETIC photos (drawn with Blender): x"
    real = retrieval_tables([outcome(1)], ["one"], dataset="x", rotation="", boxes="", drawn_with="Blender")
    assert "Blender" not in real.title


def test_rotation_errors_and_the_papers_tables() -> None:
    outcomes = [outcome(1, names=("sm2", "mine"), error=e) for e in (3.0, 30.0, 170.0, None)]
    found = retrieval_tables(
        outcomes, ["sm2", "mine"], dataset="x", rotation="", boxes="", measure_notes={"sm2": "Dense."},
        notes=["Small."], beside_paper=True,
    )  # fmt: skip
    assert found.within_30 == (2, 3)
    assert [table.note for table in found.tables] == ["Dense.", ""] and found.notes == ("Small.",)
    assert [other.caption[:19] for other in found.beside] == ["THE PAPER'S Table 2", "THE PAPER'S Table 4"]
    delf = retrieval_tables(
        [outcome(1, names=("delf-sm3", "sm3"))], ["delf-sm3", "sm3"], dataset="x", rotation="", boxes="",
        beside_paper=True,
    )  # fmt: skip
    assert [other.caption[:19] for other in delf.beside] == ["THE PAPER'S Table 3", "THE PAPER'S Table 4"]
    bare = retrieval_tables([outcome(1)], ["one"], dataset="x", rotation="", boxes="")
    assert bare.within_30 is None and bare.beside == ()
