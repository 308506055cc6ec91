"""`cadpose evaluate rotation`: the report, and photos made harder."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.evaluation.report import FILES
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Photo, Rotation, RotationHypothesis
from tests.cli.invoking import cadpose, one_sentence, said
from tests.small_library import save, shoot

TRUE = Rotation(35, 12, 4)
Seen = list[tuple[NDArray[np.uint8], Box]]


@pytest.fixture
def labels(small_library: Library, tmp_path: Path) -> Path:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE)
    save(tmp_path / "photos" / "street.png", shot.photo.rgb)
    label = {
        "photo": "street.png",
        "category": "car",
        "box": list(shot.box.to_tuple()),
        "azimuth": TRUE.azimuth,
        "elevation": TRUE.elevation,
        "inplane": TRUE.inplane,
    }
    path = tmp_path / "photos" / "labels.json"
    path.write_text(json.dumps([label, label | {"photo": "gone.png"}]))
    return path


@pytest.fixture
def seen(monkeypatch: pytest.MonkeyPatch) -> Iterator[Seen]:
    """What the estimator is shown; it always answers with a flagged half turn, then with the truth."""
    shown: Seen = []

    def estimate(self: Annotator, photo: Photo, box: Box, *_: Any) -> list[RotationHypothesis]:
        shown.append((photo.rgb, box))
        flipped = Rotation(TRUE.azimuth + 180, TRUE.elevation, TRUE.inplane)
        return [RotationHypothesis(flipped, 1.0, 0.25, 80.0, True), RotationHypothesis(TRUE, 0.9, 0.6, 30.0)]

    monkeypatch.setattr(Annotator, "estimate_rotation", estimate)
    yield shown


def test_a_report_with_everything(small_library: Library, labels: Path, tmp_path: Path, seen: Seen) -> None:
    folder = tmp_path / "report"
    common = ["evaluate", "rotation", labels, "--library", small_library.path]
    result = cadpose(*common, "--report", folder)
    # The photo that is gone makes the exit code 1, and the report is there all the same.
    assert result.exit_code == 1 and "gone.png" in result.stderr
    assert f"Report: {folder / 'report.html'}" in result.stdout
    assert "Best of five hypotheses: Acc@30 100.0%" in result.stdout
    assert "Probabilities: ECE 0.250, Brier score 0.062" in result.stdout
    assert sorted(p.name for p in folder.iterdir()) == sorted(FILES)
    lines = [json.loads(line) for line in (folder / "results.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [line["flagged"] for line in lines] == [True, None]
    assert [h["error"] for h in lines[0]["hypotheses"]] == pytest.approx([180.0, 0.0], abs=30.0)
    assert "gone.png" in lines[1]["reason"]
    assert "needs review" not in result.stderr and "Perturbation" not in (folder / "report.html").read_text()
    table = said(cadpose(*common, "--json"))
    assert (table["acc30"], table["acc30_top5"], table["n"], table["yield"]) == (0.0, 1.0, 1, 0.5)
    assert (table["precision_unflagged"], table["coverage_unflagged"]) == (None, 0.0)
    assert table["ece"] == pytest.approx(0.25) and table["brier"] == pytest.approx(0.0625)
    assert sum(table["error_histogram"]["counts"]) == 1


def test_photos_are_made_harder(small_library: Library, labels: Path, tmp_path: Path, seen: Seen) -> None:
    common = ["evaluate", "rotation", labels, "--library", small_library.path]
    cadpose(*common)
    (plain, box), folder = seen.pop(), tmp_path / "report"
    cadpose(*common, "--jitter", "0.1")
    assert np.array_equal(seen[-1][0], plain) and seen[-1][1] != box
    cadpose(*common, "--shrink", "16")
    assert not np.array_equal(seen[-1][0], plain) and seen[-1][1] == box
    cadpose(*common, "--turn", "30", "--report", folder)
    truth = json.loads((folder / "results.jsonl").read_text(encoding="utf-8").splitlines()[0])["truth"]
    assert 1.0 < abs(truth["inplane"] - TRUE.inplane) <= 30.0 and truth["azimuth"] == TRUE.azimuth
    assert "turned by up to 30°" in (folder / "report.html").read_text(encoding="utf-8")
    # Once for the estimate; the sheet shows the same turned photo.
    turned, again = seen[-1][0], seen[-1][0].copy()
    cadpose(*common, "--turn", "30")
    assert np.array_equal(seen[-1][0], turned) and np.array_equal(again, turned)
    cadpose(*common, "--turn", "30", "--seed", "1")
    assert seen[-1][0].shape != turned.shape or not np.array_equal(seen[-1][0], turned)


@pytest.mark.parametrize(
    "options",
    [["--jitter", "0.5"], ["--jitter", "nan"], ["--shrink", "0"], ["--turn", "181"], ["--turn", "nan"]],
)
def test_wrong_usage(labels: Path, options: list[str]) -> None:
    assert cadpose("evaluate", "rotation", labels, *options).exit_code == 2


def test_a_report_that_cannot_be_written_is_told_before_the_work(
    small_library: Library, labels: Path, tmp_path: Path, seen: Seen
) -> None:
    common = ["evaluate", "rotation", labels, "--library", small_library.path, "--report"]
    (tmp_path / "file").write_text("")
    one_sentence(cadpose(*common, tmp_path / "file"), "file")
    (labels.parent / "street.png").rename(labels.parent / "worst.png")
    labels.write_text(labels.read_text().replace("street.png", "worst.png"))
    one_sentence(cadpose(*common, labels.parent), "worst.png", "written over")
    assert not seen
