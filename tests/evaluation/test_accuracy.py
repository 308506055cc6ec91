"""Accuracy on real photographs, a sample of what `cadpose evaluate` measures on all of them."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.datasets.labels import Label, object_in_photo, read_gallery, read_labels
from cadpose.errors import CadposeError
from cadpose.evaluation.retrieval import evaluate_retrieval, retrieval_ranking, retrieval_table
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
    rank = retrieval_ranking(annotator, read_gallery(bench / "bench/cars/gallery.json"), "true")
    table = retrieval_table(evaluate_retrieval(labels, rank, CadposeError))
    assert table["n"] == len(labels) >= 25
    assert table["yield"] == 1.0
    assert table["top3"] >= 0.92, table
    assert table["top1"] >= 0.80, table
