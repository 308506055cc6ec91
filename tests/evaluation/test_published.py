"""The paper's figures, against the totals that it prints."""

from __future__ import annotations

import pytest

from cadpose.evaluation.published import TABLE_4, TABLES_1_TO_3

# Total row and success rates as printed; the paper cuts the last digit, so half a unit is not enough.
PRINTED = {
    "sm1": ((290, 97, 47, 434), (48.65, 16.27, 7.88, 72.81)),
    "sm2": ((289, 111, 53, 453), (48.48, 18.62, 8.89, 76.00)),
    "sm3": ((279, 105, 61, 445), (46.81, 17.61, 10.23, 74.66)),
}


@pytest.mark.parametrize("measure", PRINTED)
def test_totals_and_rates_are_those_printed(measure: str) -> None:
    table, (counts, rates) = TABLES_1_TO_3[measure], PRINTED[measure]
    total = table.total
    assert (total.first, total.second, total.third, total.top(3)) == counts
    assert (total.used, total.photos, len(table.rows)) == (596, 1000, 10)
    found = total.rates
    assert found is not None
    told = [100 * v for v in (found.first, found.second, found.third, found.top3)]
    assert told == pytest.approx(rates, abs=0.0101)
    assert total.end_to_end(1) == counts[0] / 1000


def test_they_are_named_as_the_papers() -> None:
    for number, table in enumerate(TABLES_1_TO_3.values(), 1):
        text = table.to_text()
        assert text.startswith(f"THE PAPER'S Table {number}: SM{number}\n") and "Printed in the paper" in text
    assert TABLE_4.to_text().startswith("THE PAPER'S Table 4")
    assert [row.top(3) for row in TABLE_4.rows] == [68, 71, 73, 78, 78]
