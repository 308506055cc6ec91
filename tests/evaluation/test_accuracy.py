"""Accuracy on real photographs, a sample of what `cadpose evaluate` measures on all of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.datasets.gallery import read_gallery
from cadpose.datasets.labels import Label, object_in_photo, read_labels
from cadpose.errors import CadposeError
from cadpose.evaluation.contest import make_contest
from cadpose.evaluation.retrieval import RetrievalRun, evaluate_retrieval
from cadpose.evaluation.retrieval_inputs import gallery_candidates, labelled_box, true_rotation
from cadpose.evaluation.retrieval_summary import measure_table
from cadpose.evaluation.rotation import evaluate_rotation, rotation_table
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import RotationHypothesis

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def annotator(bench: Path, cars: Library, tmp_path_factory: pytest.TempPathFactory) -> Annotator:
    # Asking for ``bench`` first skips before the library is made.
    assert bench.is_dir()
    return Annotator(cars, cache=tmp_path_factory.mktemp("galleries"))


def test_rotation_of_cars(bench: Path, annotator: Annotator) -> None:
    labels = read_labels(bench / "bench/cars_rotation/labels.json", "car")[::10]

    def estimate(label: Label) -> list[RotationHypothesis]:
        return annotator.estimate_rotation(*object_in_photo(label), label.category)

    table = rotation_table(evaluate_rotation(labels, estimate, CadposeError))
    assert table["n"] == len(labels) >= 50
    assert table["yield"] == 1.0
    assert table["acc30"] >= 0.90, table
    assert table["mederr"] <= 9.0, table


def test_retrieval_of_cars_at_the_true_rotation(bench: Path, annotator: Annotator) -> None:
    labels = read_labels(bench / "bench/cars/pairs.json", "car")[::5]
    gallery = read_gallery(bench / "bench/cars/gallery.json")
    run = RetrievalRun(
        annotator,
        make_contest(annotator, ["aligned"]),
        gallery_candidates(annotator.library, gallery),
        labelled_box,
        true_rotation,
    )
    total = measure_table(evaluate_retrieval(labels, run.outcome), "aligned").total
    assert total.used == len(labels) >= 25
    assert (total.rate(3) or 0.0) >= 0.92, total
    assert (total.rate(1) or 0.0) >= 0.80, total
