"""The tables as text, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json

from cadpose.evaluation.published import TABLE_4, TABLES_1_TO_3
from cadpose.evaluation.rank_counts import RankCounts, Rates
from cadpose.evaluation.retrieval_tables import (
    Certainty,
    MeasureTable,
    MethodTable,
    Rejected,
    RetrievalTables,
    aligned,
)

ROWS = (RankCounts("bag", 10, 8, 3, 2, 1), RankCounts("car", 10, 10, 5, 1, 1))
TABLE = MeasureTable(
    "sm1",
    ROWS,
    RankCounts("all", 20, 18, 8, 3, 2),
    (Rates("macro mean of categories", 0.4375, 0.175, 0.1125),),
    (Rates("chance", 0.1, 0.1, 0.1),),
    (Rejected("detection", "car taken for truck", 2),),
    note="sm1 is something else here.",
)
SURE = MeasureTable(
    "joint",
    (RankCounts("bag", 10, 10, 9, 0, 0, 5, 4), RankCounts("car", 10, 10, 8, 0, 0, 0, 0)),
    RankCounts("all", 20, 20, 17, 0, 0, 5, 4),
    certainty=Certainty(0.9, 0.03, 0.1),
)


def tables(*some: MeasureTable, synthetic: bool = False, drawn_with: str = "") -> RetrievalTables:
    return RetrievalTables("cars/pairs.json", synthetic, "true", "as labelled", some, drawn_with, (9, 10))


def cells(text: str, start: str) -> list[str]:
    (line,) = [line for line in text.splitlines() if line.startswith(start)]
    return line.removeprefix(start).split()


def test_the_papers_rows() -> None:
    text = TABLE.to_text()
    assert text.startswith("Measure sm1\nCategory")
    assert cells(text, "bag (8)")[:5] == ["10", "3", "2", "1", "6"]
    assert cells(text, "Total (18)")[:5] == ["20", "8", "3", "2", "13"]
    assert cells(text, "Success rate (%)") == ["44.44", "16.67", "11.11", "72.22"]
    assert cells(text, "95 % interval")[0] == "24.6-66.3"
    assert cells(text, "Of all photos (%)") == ["40.00", "15.00", "10.00", "65.00"]
    assert cells(text, "Macro mean of categories (%)") == ["43.75", "17.50", "11.25", "72.50"]
    assert cells(text, "Chance (%)") == ["10.00", "10.00", "10.00", "30.00"]
    assert "37.5 [13.7, 69.4]" in text and "Accepted" not in text
    assert "Yield: 18 of 20 photos (90.0%); rejected at\n  detection 2: car taken for truck (2)\n" in text
    assert text.endswith("sm1 is something else here.\n")


def test_all_columns_stand_below_one_another() -> None:
    lines = TABLE.to_text().splitlines()[1:13]
    numbers = [line for line in lines if "(" in line[:16] and "Mean" not in line]
    assert {len(line) for line in numbers if "[" in line} == {len(lines[0])}
    assert aligned([["ab", "1"], None, ["c", "100"], ["d"]]) == "ab    1\n-------\nc   100\nd"


def test_reasons_are_grouped_and_cut() -> None:
    many = tuple(Rejected("pose", f"reason {i}", 9 - i) for i in range(7))
    rejected = (*many, Rejected("photo", "gone", 1))
    text = MeasureTable("m", (), RankCounts("all", 50, 1, 0, 0, 0), rejected=rejected).to_text()
    assert "pose 42: reason 0 (9); reason 1 (8)" in text and "2 further reasons" in text
    assert "reason 5" not in text and "photo 1: gone (1)" in text


def test_accepted_photos_have_their_columns() -> None:
    text = SURE.to_text()
    assert cells(text, "bag (10)")[-2:] == ["5", "80.0"] and cells(text, "car (10)")[-2:] == ["0", "-"]
    assert cells(text, "Total (20)")[-2:] == ["5", "80.0"]
    assert "probability of at least 0.9" in text and "ECE 0.030" in text
    assert "Of all photos" not in text and "rejected" not in text
    told = SURE.to_json()
    assert told["certainty"] == {"threshold": 0.9, "ece": 0.03, "brier": 0.1}
    assert told["classes"]["bag"]["accepted"]["precision"] == 0.8


def test_the_title_says_whether_the_photos_are_real() -> None:
    assert tables(TABLE).title == "CAD retrieval, real photos: cars/pairs.json"
    drawn = tables(TABLE, SURE, synthetic=True, drawn_with="Blender")
    assert drawn.title == "CAD retrieval, SYNTHETIC photos (drawn with Blender): cars/pairs.json"
    assert drawn.to_text().startswith(drawn.title + "\n")
    assert "All measures, SYNTHETIC photos" in drawn.to_text()
    assert "All measures" not in tables(TABLE).to_text()
    assert "Rotation within 30°: 9 of 10: 90.0% [59.6%, 98.2%]" in drawn.to_text()


def test_all_measures_side_by_side() -> None:
    text = tables(TABLE, SURE).comparison().to_text()
    assert cells(text, "sm1")[:7] == ["18", "of", "20", "8", "3", "2", "13"]
    assert cells(text, "joint")[3:7] == ["17", "0", "0", "17"]
    assert cells(text, "sm1")[-6:-3] == ["40.0", "[21.9,", "61.3]"]


def test_what_others_published_comes_last_under_its_own_name() -> None:
    beside = RetrievalTables("a", False, "", "", (TABLE,), beside=(TABLES_1_TO_3["sm1"], TABLE_4))
    text = beside.to_text()
    assert text.index("Measure sm1") < text.index("THE PAPER'S Table 1") < text.index("THE PAPER'S Table 4")
    told = beside.to_json()
    assert set(told["measures"]) == {"sm1"}
    assert told["published"]["THE PAPER'S Table 1: SM1"]["n"] == 596
    assert told["published"][TABLE_4.caption]["SM2"]["top3"] == 0.78
    rows = list(csv.DictReader(io.StringIO(beside.to_csv())))
    assert {row["photos_are"] for row in rows} == {"real", "published"}
    assert [row["measure"] for row in rows if row["dataset"] == TABLE_4.caption][-1] == "SM3"


def test_csv_has_one_row_a_line_of_the_tables() -> None:
    text = tables(TABLE, SURE, synthetic=True).to_csv()
    rows = list(csv.DictReader(io.StringIO(text)))
    assert [(r["measure"], r["row"], r["name"]) for r in rows] == [
        ("sm1", "category", "bag"), ("sm1", "category", "car"), ("sm1", "total", "all"),
        ("sm1", "mean", "macro mean of categories"), ("sm1", "baseline", "chance"),
        ("joint", "category", "bag"), ("joint", "category", "car"), ("joint", "total", "all"),
    ]  # fmt: skip
    first, total, mean = rows[0], rows[2], rows[3]
    assert {r["photos_are"] for r in rows} == {"synthetic"}
    assert [first[k] for k in ("photos", "used", "rank1", "rank2", "rank3", "top3")] == [
        "10",
        "8",
        "3",
        "2",
        "1",
        "6",
    ]
    assert (first["top1_%"], first["accepted"]) == ("37.500", "")
    assert (total["all_top1_%"], total["all_top3_%"]) == ("40.000", "65.000")
    assert (mean["top1_%"], mean["top3_%"], mean["used"]) == ("43.750", "72.500", "")
    assert (rows[5]["accepted"], rows[5]["accepted_right"]) == ("5", "4")
    assert len({len(line) for line in csv.reader(io.StringIO(text))}) == 1


def test_json_holds_all_of_it() -> None:
    told = json.loads(json.dumps(tables(TABLE, SURE).to_json(), allow_nan=False))
    assert (told["synthetic"], told["dataset"], told["rotation_within_30"]) == (
        False,
        "cars/pairs.json",
        [9, 10],
    )
    one = told["measures"]["sm1"]
    assert (one["n"], one["photos"], one["yield"], one["ranks"]) == (18, 20, 0.9, [8, 3, 2])
    assert one["classes"]["bag"]["top1"] == 0.375 and one["certainty"] is None
    assert one["macro"]["macro mean of categories"]["top1"] == 0.4375
    assert one["baselines"]["chance"]["top3"] == 0.1 * 3
    assert one["rejected"] == [{"stage": "detection", "reason": "car taken for truck", "photos": 2}]
    assert one["end_to_end"]["top1"] == 0.4 and len(one["end_to_end"]["top3_interval"]) == 2


def test_a_table_without_any_answer() -> None:
    nothing = MeasureTable("m", (RankCounts("car", 2, 0, 0, 0, 0),), RankCounts("all", 2, 0, 0, 0, 0))
    text = tables(nothing).to_text()
    assert cells(text, "car (0)") == ["2", "0", "0", "0", "0", "-", "-"] and "Success rate" not in text
    json.dumps(tables(nothing).to_json(), allow_nan=False)
    assert len(list(csv.reader(io.StringIO(tables(nothing).to_csv())))) == 3
    assert MethodTable("x", ()).to_text().startswith("x\nMethod")
