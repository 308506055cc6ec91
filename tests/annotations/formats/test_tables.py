"""CSV and Parquet: one row an annotation, as csv, pyarrow and its data frames read them."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import pytest

from cadpose.annotations.formats.registry import documents_from, export
from cadpose.annotations.formats.rows import COLUMNS
from cadpose.errors import DependencyError, InputError
from tests.annotations.formats.made import Made


def test_csv_rows(made: Made, tmp_path: Path) -> None:
    out = made.export("csv", tmp_path / "a.csv")
    rows = list(csv.DictReader(out.open(encoding="utf-8", newline="")))
    parts = [part for document in made.documents for part in document.annotations]
    assert len(rows) == len(parts) == 4 and list(rows[0]) == list(COLUMNS)
    for row, part in zip(rows, parts, strict=True):
        assert (row["category"], row["cad_id"]) == (part.detection.category, part.cad.id)
        numbers = [float(row[name]) for name in ("azimuth", "elevation", "inplane", "focal_px")]
        pose = part.pose
        assert numbers == [pose.azimuth, pose.elevation, pose.inplane, pose.focal_px]
        assert (row["mask"] == "") == (part.detection.mask is None)


def test_what_csv_carries_comes_back(made: Made, tmp_path: Path) -> None:
    again = made.again("csv", tmp_path / "a.csv")
    pairs = [
        (a, b)
        for told, document in zip(again, made.documents, strict=False)
        for a, b in zip(told.annotations, document.annotations, strict=True)
    ]
    assert len(pairs) == 4
    for told, part in pairs:
        assert told.pose == part.pose and told.cad == part.cad
        for name in ("box", "category", "score", "source", "mask", "truncated", "tiny", "unsure"):
            assert getattr(told.detection, name) == getattr(part.detection, name)
        for name in ("none_probability", "cad_needs_review", "box_iou", "mask_iou", "confidence", "verdict"):
            assert getattr(told, name) == getattr(part, name)
        assert told.candidates[0].score == part.candidates[0].score
        # What the page says is lost.
        assert len(told.candidates) == 1 and told.hypotheses == () and told.pose_6dof is None
        assert told.provenance == {"imported_from": "csv"} and told.seconds == {}
        assert told.detection.alternatives == () and told.detection.rotation is None


def test_parquet_columns(made: Made, tmp_path: Path) -> None:
    pq = pytest.importorskip("pyarrow.parquet")
    table = pq.read_table(made.export("parquet", tmp_path / "a.parquet"))
    parts = [part for document in made.documents for part in document.annotations]
    assert table.num_rows == 4
    kinds = {str: "string", int: "int64", float: "double", bool: "bool"}
    assert {n: str(table.schema.field(n).type) for n in COLUMNS} == {n: kinds[k] for n, k in COLUMNS.items()}
    assert table["azimuth"].to_pylist() == [part.pose.azimuth for part in parts]
    assert table["verdict"].to_pylist() == [part.verdict for part in parts]


def test_row_groups_and_batches_do_not_show(
    made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("pyarrow")
    monkeypatch.setattr("cadpose.annotations.formats.parquet._GROUP", 1)
    monkeypatch.setattr("cadpose.annotations.formats.parquet._BATCH", 1)
    again = made.again("parquet", tmp_path / "a.parquet")
    assert [d.annotations for d in again] == [d.annotations for d in made.documents[:3]]


def test_without_pyarrow(made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    with pytest.raises(DependencyError, match=r"pip install 'cadpose\[parquet\]'"):
        made.export("parquet", tmp_path / "a.parquet")
    assert list(tmp_path.iterdir()) == []


def change(path: Path, edit: Any) -> list[Any]:
    rows = list(csv.DictReader(path.open(encoding="utf-8", newline="")))
    edit(rows)
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, list(rows[0]))
        table.writeheader()
        table.writerows(rows)
    return list(documents_from("csv", path))


def test_edited_rows_count(made: Made, tmp_path: Path) -> None:
    def edit(rows: Any) -> None:
        rows[0] |= {"x0": "1", "category": "van", "azimuth": "90", "verdict": ""}
        del rows[2]

    street, hostile = change(made.export("csv", tmp_path / "a.csv"), edit)
    first = street.annotations[0]
    assert (first.detection.box[0], first.detection.category, first.verdict) == (1.0, "van", None)
    assert first.pose.azimuth == 90.0 and first.pose.R_cv_from_s[0][0] == pytest.approx(0.0, abs=0.2)
    assert hostile.photo.name == "../../e vil;$(x).png"


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda rows: rows[0].update(azimuth="north"), "line 2: azimuth is 'north', which is no float"),
        (lambda rows: rows[0].update(azimuth="nan"), "no valid annotation"),
        (lambda rows: rows[0].update(azimuth=""), "no valid annotation"),
        (lambda rows: rows[0].update(x0=""), "has no box"),
        (lambda rows: rows[0].update(tiny="maybe"), "no bool"),
        (lambda rows: rows[0].update(mask="~"), "unusable mask"),
        (lambda rows: rows[0].update(photo_sha256="x"), "no valid annotation"),
        (lambda rows: [row.pop("cad_id") for row in rows], "no column cad_id"),
        (lambda rows: rows.append(rows[0]), "scattered"),
    ],
)
def test_mistakes_name_the_line(made: Made, tmp_path: Path, edit: Any, words: str) -> None:
    path = made.export("csv", tmp_path / "a.csv")
    with pytest.raises(InputError, match=words) as caught:
        change(path, edit)
    assert str(caught.value).startswith(str(path))


def test_memory_does_not_grow_with_the_photos(made: Made, tmp_path: Path) -> None:
    """Documents are taken one after the other, none is kept."""
    import gc
    import weakref

    held: list[weakref.ref[Any]] = []

    def stream() -> Any:
        for number in range(50):
            document = made.documents[1].model_copy(deep=True)
            held.append(weakref.ref(document))
            gc.collect()
            assert sum(ref() is not None for ref in held) <= 3, number
            yield document

    for name in ("coco", "csv", "label-studio", "pascal3d", "parquet"):
        held.clear()
        export(name, stream(), tmp_path / name, made.sources)
