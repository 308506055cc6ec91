"""The page of a retrieval evaluation: examples, diagrams, tables."""

from __future__ import annotations

import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.style import RIGHT, WRONG
from cadpose.datasets.labels import Label
from cadpose.evaluation import figures
from cadpose.evaluation.contest import Ranking
from cadpose.evaluation.retrieval import Outcome
from cadpose.evaluation.retrieval_figures import category_map, measure_bars
from cadpose.evaluation.retrieval_report import draw_examples, write_retrieval_report
from cadpose.evaluation.retrieval_strips import draw_strip, examples, strip_of
from cadpose.evaluation.retrieval_summary import retrieval_tables
from cadpose.evaluation.retrieval_tables import RetrievalTables
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Candidate, Rotation
from tests.batch.fakes import fake_annotator
from tests.evaluation.retrieving import outcome, rejected
from tests.small_library import save

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "_DPI", 60)


@pytest.fixture
def annotator(small_library: Library) -> Annotator:
    return fake_annotator(small_library)


def real(library: Library, folder: Path, place: int, name: str = "a.png") -> Outcome:
    """The hatch at a place among all five models of the library."""
    path = save(folder / name, np.full((60, 80, 3), 90, np.uint8))
    ids = [cad.id for cad in library.models() if cad.id != "made/car/hatch.obj"]
    ids.insert(place - 1, "made/car/hatch.obj")
    turn = Rotation(40, 10)
    candidates = tuple(Candidate(library.get(i), 5.0 - n, turn) for n, i in enumerate(ids))
    label = Label(path, "car", None, "made/car/hatch.obj")
    return Outcome(label, {"one": Ranking(candidates, 0.5)}, tuple(ids), Box(5, 5, 70, 50), turn)


def tables_of(outcomes: list[Outcome], *names: str, beside_paper: bool = False) -> RetrievalTables:
    return retrieval_tables(
        outcomes, names, dataset="set", rotation="true", boxes="true", beside_paper=beside_paper
    )


def framed(picture: Image.Image, colour: tuple[int, int, int]) -> list[int]:
    """Numbers of the tiles with a frame of that colour."""
    rgb = np.asarray(picture).astype(int)
    columns = np.flatnonzero((np.abs(rgb - colour).max(axis=-1) < 8).sum(axis=0) > 60)
    return sorted({int(x - 8) // 138 for x in columns})


def test_the_true_model_is_framed_green(annotator: Annotator, small_library: Library, tmp_path: Path) -> None:
    for place, green, red in ((1, [1], []), (3, [3], [1])):
        strip = strip_of(annotator, real(small_library, tmp_path, place), "one")
        assert strip is not None and len(strip.shown) == 5
        picture = draw_strip(strip)
        assert framed(picture, RIGHT) == green and framed(picture, WRONG) == red
        # The models are drawn, each another.
        tiles = [np.asarray(picture.crop((8 + 138 * i, 8, 140 + 138 * i, 140))) for i in range(1, 6)]
        assert all(tile.std() > 15 for tile in tiles)


def test_a_true_model_beyond_the_fifth_place_follows(
    annotator: Annotator, small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cadpose.evaluation.retrieval_strips.SHOWN", 3)
    strip = strip_of(annotator, real(small_library, tmp_path, 5), "one")
    assert strip is not None and [place for place, _ in strip.shown] == [1, 2, 3, 5]
    assert framed(draw_strip(strip), RIGHT) == [4]


def test_what_cannot_be_drawn_is_left_out(
    annotator: Annotator, small_library: Library, tmp_path: Path
) -> None:
    gone = real(small_library, tmp_path, 1)
    gone.label.photo.unlink()
    assert strip_of(annotator, gone, "one") is None and strip_of(annotator, rejected(), "one") is None
    assert draw_examples(annotator, [gone, rejected()], ["one"]) == {"one": ([], [])}


def test_examples_go_round_the_categories() -> None:
    cars = [outcome(1, photo=f"c{i}", lead=float(i)) for i in range(5)]
    chair = outcome(1, "chair", photo="chair", lead=50.0)
    good, bad = examples([*cars, chair, rejected()], "one", 3, 9)
    # The typical lead first, then the other category before a second car.
    assert [o.label.photo.name for o in good][:2] in (["c2", "chair"], ["c3", "chair"])
    assert len(good) == 3 and bad == []
    wrong = [outcome(k, photo=f"p{k}") for k in (2, 5, 3)] + [outcome(None, photo="none")]
    _, bad = examples([*wrong, outcome(4, "chair", photo="chair")], "one", 0, 3)
    assert [o.label.photo.name for o in bad] == ["none", "chair", "p5"]


def test_diagrams_show_something() -> None:
    outcomes = [
        outcome(1, names=("x", "y")),
        outcome(3, "chair", names=("x", "y")),
        rejected(names=("x", "y")),
    ]
    tables = tables_of(outcomes, "x", "y")
    for data in (measure_bars(tables), category_map(tables)):
        picture = np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))
        assert min(picture.shape[:2]) > 100 and picture.std() > 5
    assert measure_bars(tables) == measure_bars(tables)
    nothing = tables_of([rejected()], "one")
    with pytest.raises(ValueError, match="no measure"):
        measure_bars(nothing)
    assert category_map(nothing)


def test_the_page_is_whole_and_inert(annotator: Annotator, small_library: Library, tmp_path: Path) -> None:
    hostile = rejected("detection", HOSTILE)
    hostile = replace(hostile, label=replace(hostile.label, category=HOSTILE))
    outcomes = [real(small_library, tmp_path, 1, "a.png"), real(small_library, tmp_path, 4, "b.png"), hostile]
    tables = replace(tables_of(outcomes, "one", beside_paper=True), dataset=HOSTILE)
    path = tmp_path / "deep" / "report.html"
    told: list[int] = []
    strips = draw_examples(annotator, outcomes, ["one"], lambda: told.append(1))
    write_retrieval_report(path, tables, strips, {"Estimator": HOSTILE, "Nothing": ""})
    html = path.read_text(encoding="utf-8")
    assert HOSTILE not in html and html.count("&lt;script&gt;") >= 4 and "Nothing" not in html
    assert "default-src 'none'" in html and "http" not in html.replace("http-equiv", "")
    sources = re.findall(r'src="([^"]*)"', html)
    assert len(sources) == 4 and all(s.startswith("data:image/") for s in sources)
    assert html.count('alt="Right answer"') == html.count('alt="Wrong answer"') == 1 == len(told)
    assert (
        "THE PAPER&#x27;S Table 4" in html and "real photos" in html and "Of all photos: top-1 33.3%" in html
    )
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_a_page_without_any_answer(tmp_path: Path) -> None:
    path = tmp_path / "report.html"
    write_retrieval_report(path, tables_of([rejected()], "one"), {}, {})
    html = path.read_text(encoding="utf-8")
    assert "1 at detection" in html and "nothing found" in html and "<img" not in html
