"""The figures of the paper's Tables 1 to 4, as printed, to be shown beside ours and named as its own.

They are of other photos (100 a category, from the web) and other models (ten a category of ShapeNetCore), so
they say what was reached there, not what these photos should give.
"""

from __future__ import annotations

from cadpose.evaluation.rank_counts import RankCounts, Rates
from cadpose.evaluation.retrieval_tables import MeasureTable, MethodTable

_NOTE = "Printed in the paper: its own photos from the web and ten ShapeNetCore models a category."
_CATEGORIES = (
    ("bag", 19), ("bed", 24), ("bench", 63), ("bottle", 77), ("car", 80), ("chair", 80), ("clock", 59),
    ("motorbike", 76), ("oven", 79), ("table", 39),
)  # fmt: skip
#: Photos with the true model at the first, second and third place, a category in that order.
_PLACES = {
    "sm1": (
        (7, 2, 0), (4, 7, 3), (38, 10, 1), (47, 14, 8), (33, 11, 8),
        (45, 21, 3), (27, 12, 4), (37, 8, 8), (34, 10, 10), (18, 2, 2),
    ),
    "sm2": (
        (7, 3, 3), (6, 7, 3), (39, 16, 2), (41, 15, 14), (33, 16, 6),
        (45, 20, 2), (26, 13, 4), (39, 8, 6), (33, 9, 12), (20, 4, 1),
    ),
    "sm3": (
        (6, 1, 4), (6, 5, 5), (39, 15, 1), (41, 14, 15), (32, 14, 6),
        (43, 20, 3), (25, 14, 5), (38, 7, 7), (33, 9, 12), (16, 6, 3),
    ),
}  # fmt: skip


def _table(number: int, measure: str) -> MeasureTable:
    rows = tuple(
        RankCounts(name, 100, used, *places)
        for (name, used), places in zip(_CATEGORIES, _PLACES[measure], strict=True)
    )
    columns = (sum(places) for places in zip(*_PLACES[measure], strict=True))
    return MeasureTable(
        measure,
        rows,
        RankCounts("all", 100 * len(rows), sum(used for _, used in _CATEGORIES), *columns),
        baselines=(Rates("chance", 0.1, 0.1, 0.1),),
        note=_NOTE,
        caption=f"THE PAPER'S Table {number}: {measure.upper()}",
    )


#: Tables 1 to 3 by measure.
TABLES_1_TO_3 = {name: _table(number, name) for number, name in enumerate(_PLACES, 1)}
#: Table 4: 100 photos that the triplet network had not seen.
TABLE_4 = MethodTable(
    "THE PAPER'S Table 4: 100 of its photos",
    (
        RankCounts("triplet loss, without negative mining", 100, 100, 31, 18, 19),
        RankCounts("triplet loss, with negative mining", 100, 100, 29, 25, 17),
        RankCounts("SM1", 100, 100, 56, 13, 4),
        RankCounts("SM2", 100, 100, 56, 16, 6),
        RankCounts("SM3", 100, 100, 51, 15, 12),
    ),
)
