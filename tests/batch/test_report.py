"""The pages of a run: figures that add up, hostile names that stay text, two thousand photos that load."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from cadpose.batch.charts import histogram, time_chart
from cadpose.batch.figures import FailedPhoto, StageTime, run_figures
from cadpose.batch.gallery import index_html
from cadpose.batch.record import AnnotatedObject, LeftOutObject, PhotoRecord
from cadpose.batch.report import Pace, report_html
from cadpose.pipeline import Annotator
from tests.batch.fakes import annotate_all
from tests.html_page import Page

HOSTILE = "<script>alert(1)</script>\"'><img src=x onerror=alert(1)>&amp;"


def found(iou: float = 0.8, confidence: float | None = 0.9, name: str = "SUV") -> AnnotatedObject:
    return AnnotatedObject(
        category="car", alternatives=(), truncated=False, tiny=False, unsure=False, box=(0.0, 1.0, 2.0, 3.0),
        cad_id=name, cad_name=name, azimuth=1.0, elevation=2.0, inplane=3.0, focal_px=100.0, probability=0.9,
        expected_error=5.0, needs_review=False, cad_probability=0.5, none_probability=0.2,
        cad_needs_review=False, confidence=confidence,
        verdict=None if confidence is None else "auto_accept" if confidence > 0.5 else "review",
        box_iou=0.9, mask_iou=iou,
    )  # fmt: skip


def record(name: str, *objects: AnnotatedObject, seconds: float = 1.0, lost: int = 0) -> PhotoRecord:
    left = LeftOutObject(
        category="lamp", alternatives=(), truncated=False, tiny=False, unsure=False, box=(0.0, 1.0, 2.0, 3.0),
        stage="library", reason="no lamp",
    )  # fmt: skip
    return PhotoRecord(
        photo=name, sha256="0" * 64, file_bytes=1, file_mtime_ns=1, size=(4, 3), made_with="x",
        output_bytes=(1, 2, 3, 4, 5), seconds={"read": seconds, "draw": 3 * seconds}, objects=objects,
        left_out=(left,) * lost,
    )  # fmt: skip


def test_the_figures_add_up() -> None:
    finished = [
        ("a", record("a.jpg", found(0.7), found(0.3, 0.2))),
        ("b", record("b.jpg", seconds=3.0)),
        ("c", record("c.jpg", found(0.5, None), lost=2)),
    ]
    failed = [FailedPhoto("d.jpg", "read", "d.jpg: broken")]
    f = run_figures(finished, failed, planned=6, copies=1)
    assert (f.finished, f.empty, f.annotated, f.found, f.pending, f.doubtful) == (3, 1, 3, 5, 2, 1)
    assert f.left_out == {("library", "no lamp"): 2}
    assert f.verdicts == {"auto_accept": 1, "review": 1, "none": 1}
    assert [(t.stage, t.median, t.share) for t in f.times] == [("read", 1.0, 0.25), ("draw", 3.0, 0.75)]
    assert [case.found.mask_iou for case in f.least_iou] == [0.3, 0.5, 0.7]
    assert [case.stem for case in f.least_sure] == ["a", "a"] and f.least_sure[0].found.confidence == 0.2
    text = Page(report_html(f, Pace(4, 2.0, "by 2 workers"), finished)).text
    told = (
        "This run did 4 photos in 2.0 s by 2 workers: 2.00 a second, 7,200 an hour.",
        "no lamp",
        "broken",
        "1 object of 3 needs review",
        "2not done yet",
    )
    assert [words for words in told if words not in text] == []


def test_hostile_names_stay_text() -> None:
    finished = [("x", record(HOSTILE, found(name=HOSTILE), lost=1))]
    failed = [FailedPhoto(HOSTILE, HOSTILE, HOSTILE)]
    figures = run_figures(finished, failed, planned=2)
    for html in (
        report_html(figures, Pace(1, 1.0, HOSTILE), finished, HOSTILE),
        index_html(finished, HOSTILE),
    ):
        page = Page(html)
        assert not {"script", "iframe", "object", "link"} & {tag for tag, _ in page.tags}
        assert not any(name.startswith("on") for _, attrs in page.tags for name in attrs)
        sources = [attrs["src"] or "" for tag, attrs in page.tags if tag == "img"]
        assert sources and all(source == "./thumbnails/x.jpg" for source in sources)
        assert all(attrs.get("loading") == "lazy" for tag, attrs in page.tags if tag == "img")
        assert HOSTILE in page.text and "default-src 'none'" in html


def test_two_thousand_photos_make_a_page_that_loads() -> None:
    names = [f"some/longer/folder/of/photos/photograph-{number:05}.jpg" for number in range(2000)]
    finished = [(f"photograph-{n:05}", record(name, found(), found())) for n, name in enumerate(names)]
    failed = [FailedPhoto(name, "read", f"{name}: broken {name}") for name in names]
    html = report_html(run_figures(finished, failed, planned=4000), Pace(1, 1.0, ""), finished)
    assert len(html) < 3_000_000
    page = Page(html)
    parts = [attrs for tag, attrs in page.tags if tag == "details"]
    assert sum("open" in attrs for attrs in parts) == 1
    assert html.count("2,000") >= 2 and "and 1,900 more" in html
    # Reasons are told apart from the names in them.
    assert re.search(r"<td>read</td><td>2,000</td><td class=\"words\">broken the photo</td>", html)
    assert index_html(finished).count("<img") == 2000


def test_charts_hold_their_values() -> None:
    chart = time_chart([StageTime("read", 1.0, 2.0, 0.5), StageTime("none", 0.0, 0.0, 0.0)])
    widths = [float(width) for width in re.findall(r'class="\w+" x="120" y="\d+" width="([\d.]+)"', chart)]
    assert widths[0] == pytest.approx(2 * widths[1]) and widths[2:] == [0.0, 0.0]
    counts = [
        int(number) for number in re.findall(r"<title>(\d+)</title>", histogram([0.0, 1.0, 1.2, 0.5], "x"))
    ]
    assert counts == [1, *[0] * 9, 1, *[0] * 8, 2]
    assert "NaN" not in time_chart([]) + histogram([], "x")


def test_pages_are_written_while_a_run_goes_on(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cadpose.batch.pages._EVERY", 0.0)
    monkeypatch.setattr("cadpose.batch.pages._TIMES", 0.0)
    from cadpose.batch.run import annotate_photos

    outcomes = annotate_photos(annotator, photos, tmp_path)
    next(outcomes)
    report = (tmp_path / "report.html").read_text()
    assert "It is still running." in report and "a.card.html" in report and "b.card.html" not in report
    list(outcomes)
    report = (tmp_path / "report.html").read_text()
    assert "still running" not in report and "c.card.html" in report
    annotate_all(annotator, photos, tmp_path)
