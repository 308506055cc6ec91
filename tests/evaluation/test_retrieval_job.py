"""What a job asks for, and what decides whether another run may go on with its outcomes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

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


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"boxes": "mine"}, "boxes must be one of true, detected, got 'mine'"),
        ({"measures": ()}, "at least one measure"),
        ({"limit": 0}, "limit must be at least 1 or None, got 0"),
        ({"accept": 1.5}, "accept must lie in"),
        ({"accept": float("nan")}, "accept must lie in"),
        ({"seed": -1}, "seed must not be negative"),
        ({"rotation": "true", "reject_flagged": True}, "only predicted rotations are flagged"),
    ],
)
def test_jobs_that_cannot_be(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        RetrievalJob(Path("labels.json"), **changes)
