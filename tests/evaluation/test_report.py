"""The report's page, diagrams and sheet, of made-up outcomes."""

from __future__ import annotations

import builtins
import io
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.datasets.labels import Label
from cadpose.errors import DependencyError, InputError
from cadpose.evaluation import figures
from cadpose.evaluation.confidence import Answers, confidence_figures
from cadpose.evaluation.report import FILES, prepare_report, results_jsonl, write_report
from cadpose.evaluation.rotation import RotationResult, rotation_result, rotation_table
from cadpose.evaluation.worst import MOST, Comparison, draw_worst, true_rotation, worst_results
from cadpose.geometry.boxes import Box
from cadpose.records import Rotation, RotationHypothesis
from tests.annotations.factory import make_cad, make_photo, make_views

HOSTILE = "<script>alert(1)</script>"


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(figures, "_DPI", 60)


def outcome(name: str, error: float, probability: float, category: str = "chair") -> RotationResult:
    found = [
        RotationHypothesis(Rotation(40.0 + error, 5.0), 1.0, probability, 20.0, probability < 0.5),
        RotationHypothesis(Rotation(40.0, 5.0), 0.5, 0.1),
    ]
    label = Label(Path("photos") / name, category, Box(1, 2, 30, 40), azimuth=40.0, elevation=5.0)
    return rotation_result(label, found[0].rotation, hypotheses=found)


@pytest.fixture(scope="module")
def results() -> list[RotationResult]:
    rng = np.random.default_rng(0)
    right = [
        outcome(f"{i}.jpg", float(rng.uniform(0, 15)), 0.9, "chair" if i % 3 else "bed") for i in range(30)
    ]
    wrong = [outcome(f"w{i}.jpg", 175.0 + i, 0.2 + i / 10) for i in range(4)]
    label = Label(Path(f"{HOSTILE}.jpg"), HOSTILE, azimuth=1.0)
    return [*right, *wrong, rotation_result(label, None, f"{HOSTILE} is cut short")]


def picture(data: bytes) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))


def test_every_diagram_shows_something(results: list[RotationResult]) -> None:
    answers = Answers.of(results)
    drawn = [
        figures.reliability_diagram(answers),
        figures.error_histogram(answers),
        figures.azimuth_confusion(results),
        figures.error_curves(results),
        figures.risk_coverage_curve(answers),
    ]
    for data in drawn:
        shown = picture(data)
        assert min(shown.shape[:2]) > 200 and shown.std() > 5.0
    # The same answers give the same file, others another.
    assert figures.error_histogram(answers) == drawn[1]
    assert figures.error_histogram(Answers.of(results[20:])) != drawn[1]


def test_diagrams_bear_a_single_answer_and_many_categories() -> None:
    one = [outcome("a.jpg", 3.0, 1.0)]
    answers = Answers.of(one)
    for draw in (figures.reliability_diagram, figures.error_histogram, figures.risk_coverage_curve):
        assert picture(draw(answers)).std() > 1.0
    many = [outcome("a.jpg", 3.0, 1.0, f"kind {i}") for i in range(30)]
    assert picture(figures.error_curves(many)).std() > 1.0


def test_the_azimuth_confusion_counts_around_the_circle() -> None:
    def turned(true: float, found: float) -> RotationResult:
        return rotation_result(Label(Path("a.jpg"), "car", azimuth=true), Rotation(found, 0.0))

    counts = figures.azimuth_counts([turned(359.0, 2.0), turned(7.0, 8.0), turned(90.0, 270.0)])
    assert counts.sum() == 3
    # Bins are centred: 352.5 to 7.5 is one.
    assert counts[0, 0] == 1 and counts[0, 1] == 1 and counts[6, 18] == 1
    failed = rotation_result(Label(Path("a.jpg"), "car", azimuth=3.0), None, "no")
    assert figures.azimuth_counts([failed]).sum() == 0


def compared(result: RotationResult) -> Comparison:
    return Comparison(
        result, make_photo(), Box(10, 10, 90, 60), make_cad(), make_views([(60, 20), (20, 60)], 64, 64)
    )


def test_the_sheet_shows_the_worst_first(results: list[RotationResult]) -> None:
    worst = worst_results(results, 3)
    assert [r.label.photo.name for r in worst] == ["w3.jpg", "w2.jpg", "w1.jpg"]
    assert len(worst_results(results)) == MOST
    sheet = np.asarray(draw_worst([compared(r) for r in worst]))
    red = np.abs(sheet.astype(int) - (200, 40, 40)).max(axis=-1) < 12
    columns = np.flatnonzero(red[: len(red) // 2].any(axis=0))
    groups = np.split(columns, np.flatnonzero(np.diff(columns) > 40) + 1)
    # Two photos a row, two renders each: wide as estimated, then narrow as labelled.
    assert [len(g) > 40 for g in groups] == [True, False, True, False]
    assert draw_worst([compared(r) for r in worst[:2]]).height < len(sheet) * 0.6
    assert draw_worst([]).width > 100


def test_a_label_of_azimuth_alone_borrows_the_rest_from_the_estimate() -> None:
    label = Label(Path("a.jpg"), "car", azimuth=10.0)
    assert true_rotation(rotation_result(label, Rotation(90, 20, 5))) == Rotation(10, 20, 5)
    whole = Label(Path("a.jpg"), "car", azimuth=10.0, elevation=1.0, inplane=2.0)
    assert true_rotation(rotation_result(whole, Rotation(90, 20, 5))) == Rotation(10, 1, 2)
    with pytest.raises(ValueError, match="neither"):
        true_rotation(rotation_result(Label(Path("a.jpg"), "car"), None))


def test_the_lines_say_everything_of_every_photo(results: list[RotationResult]) -> None:
    lines = [json.loads(line) for line in results_jsonl(results).splitlines()]
    assert len(lines) == len(results)
    first, last = lines[30], lines[-1]
    assert first["photo"] == str(Path("photos") / "w0.jpg") and first["box"] == [1, 2, 30, 40]
    assert first["truth"] == {"azimuth": 40.0, "elevation": 5.0, "inplane": None}
    assert first["error"] == pytest.approx(results[30].error) and first["flagged"] is True
    assert [h["probability"] for h in first["hypotheses"]] == [0.2, 0.1]
    assert [h["error"] for h in first["hypotheses"]] == pytest.approx([results[30].error, 0.0])
    assert first["hypotheses"][0]["expected_error"] == 20.0 and first["reason"] is None
    assert (last["error"], last["flagged"], last["hypotheses"]) == (None, None, [])
    assert last["reason"].endswith("cut short")


def test_the_page_is_whole_inert_and_beside_its_pictures(
    results: list[RotationResult], tmp_path: Path
) -> None:
    table = rotation_table(results) | confidence_figures(results)
    worst = [compared(r) for r in worst_results(results, 3)]
    folder = tmp_path / "deep" / "report"
    path = write_report(folder, results, table, worst, {"Labels": HOSTILE, "Perturbation": ""})
    assert sorted(p.name for p in folder.iterdir()) == sorted(FILES)
    html = path.read_text(encoding="utf-8")
    assert HOSTILE not in html and html.count("&lt;script&gt;") >= 3
    assert "default-src 'none'" in html and "http" not in html.replace("http-equiv", "")
    sources = re.findall(r'src="([^"]*)"', html)
    assert len(sources) == 6 and all(s.startswith("data:image/") for s in sources)
    assert f"{table['acc30']:.1%}" in html and f"ECE {table['ece']:.3f}" in html
    assert "not calibrated" not in html and "Perturbation" not in html and "Without an answer: 1" in html


def test_a_page_without_any_answer_says_why(tmp_path: Path, results: list[RotationResult]) -> None:
    failed = results[-1:]
    table = rotation_table(failed) | confidence_figures(failed)
    html = write_report(tmp_path, failed, table, [], {}).read_text(encoding="utf-8")
    assert "cut short" in html and "Diagrams" not in html
    assert not (tmp_path / "errors.png").exists()


def test_shares_are_called_what_they_are(tmp_path: Path) -> None:
    plain = [RotationHypothesis(Rotation(3.0, 0.0), 1.0, 0.7)]
    result = rotation_result(Label(Path("a.jpg"), "car", azimuth=0.0), Rotation(3.0, 0.0), hypotheses=plain)
    table = rotation_table([result]) | confidence_figures([result])
    assert "not calibrated" in write_report(tmp_path, [result], table, [], {}).read_text(encoding="utf-8")


def test_a_report_spares_its_inputs_and_needs_a_folder(tmp_path: Path) -> None:
    prepare_report(tmp_path / "new", [tmp_path / "labels.json"])
    assert (tmp_path / "new").is_dir()
    with pytest.raises(InputError, match=r"results\.jsonl would be written over"):
        prepare_report(tmp_path, [tmp_path / "new" / ".." / "results.jsonl"])
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        prepare_report(tmp_path / "file", [])


def test_without_matplotlib_one_sentence_tells_how_to_get_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def without(name: str, *rest: Any) -> Any:
        if name.partition(".")[0] == "matplotlib":
            raise ImportError("No module named 'matplotlib'")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(DependencyError, match=r"pip install 'matplotlib"):
        prepare_report(tmp_path / "new", [])
    assert not (tmp_path / "new").exists()
