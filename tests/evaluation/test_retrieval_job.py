"""What a job asks for, and what decides whether another run may go on with its outcomes."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.evaluation.retrieval_job import RetrievalJob, run_job
from cadpose.library.catalogue import Library
from cadpose.similarity.triplet import TripletMeasure
from tests.batch.fakes import fake_annotator
from tests.small_library import save


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    save(tmp_path / "a.png", np.full((60, 80, 3), 90, np.uint8))
    entry = {"photo": "a.png", "category": "car", "cad": "made/car/hatch.obj", "azimuth": 35, "elevation": 12}
    (tmp_path / "labels.json").write_text(json.dumps([entry]))
    return tmp_path / "labels.json"


def test_a_run_goes_on_with_the_same_network_only(
    small_library: Library, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    network = tmp_path / "triplet.onnx"
    network.write_bytes(b"one")
    monkeypatch.setenv("CADPOSE_TRIPLET", str(network))
    monkeypatch.setattr(
        TripletMeasure, "score", lambda self, crop, mask, views, aspect=None: np.arange(float(len(views)))
    )
    job = RetrievalJob(dataset, measures=("triplet",), rotation="true")
    annotator, out = fake_annotator(small_library), tmp_path / "out"
    run_job(job, annotator, out)
    network.write_bytes(b"two")
    with pytest.raises(InputError, match=r"other settings \(networks\)"):
        run_job(job, annotator, out, resume=True)
    network.write_bytes(b"one")
    run_job(job, annotator, out, resume=True)
