from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch

from cadpose.errors import InputError
from cadpose.photos import crop_square, read_photo
from cadpose.rotation.bins import decode, encode_angles
from cadpose.rotation.posecontrast import OUTPUTS, PoseContrastEstimator
from cadpose.training.architectures import TrainingOptions, TrainingReport
from cadpose.training.checkpoints import read_checkpoint
from cadpose.training.posecontrast import augment
from cadpose.training.posecontrast.data import training_batches, training_labels, validation_labels
from cadpose.training.posecontrast.export import export_onnx
from cadpose.training.posecontrast.network import normalised
from cadpose.training.posecontrast.train import RECIPE, export, loss_of, train
from tests.training.posecontrast.made import TINY, authors_content, write_photos


@pytest.fixture(scope="module", autouse=True)
def _small_crops(one_thread: None) -> Iterator[None]:
    """The network takes any size; a training of 64 px takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(augment, "SIDE", 64)
        yield


@pytest.fixture(scope="module")
def labels(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_photos(tmp_path_factory.mktemp("photos"))


def run(labels: Path, out: Path, *, epochs: int = 3, **told: Any) -> TrainingReport:
    options: dict[str, Any] = {"data": labels, "out": out, "init": "random", "epochs": epochs, "workers": 2}
    options |= told
    return train(TrainingOptions(**options), lambda done, total: None, TINY)


@pytest.fixture(scope="module")
def whole(labels: Path, tmp_path_factory: pytest.TempPathFactory) -> TrainingReport:
    return run(labels, tmp_path_factory.mktemp("whole"), validation=labels)


def test_the_published_recipe() -> None:
    assert (RECIPE.epochs, RECIPE.batch_size, RECIPE.rate, RECIPE.weight_decay) == (15, 32, 1e-4, 5e-4)
    assert (RECIPE.contrast, RECIPE.weighting, RECIPE.temperature) == (1.0, "linear", 0.5)
    assert [RECIPE.rate_in(e) for e in (1, 11)] == [1e-4, 1e-4]
    assert [RECIPE.rate_in(e) for e in (12, 15)] == pytest.approx([1e-5, 1e-5])


def test_what_a_training_leaves(whole: TrainingReport) -> None:
    rows = [json.loads(line) for line in whole.curves.read_text().splitlines()]
    assert rows == whole.epochs and [row["epoch"] for row in rows] == [1, 2, 3]
    for row in rows:
        assert row["loss"] == pytest.approx(row["angle_loss"] + row["contrast_loss"], rel=1e-5)
        assert 0 <= row["val_acc30"] <= 1
    assert whole.validation is not None and set(whole.validation["classes"]) == {"car", "chair"}
    assert whole.difference is not None and whole.difference <= 1e-4 and whole.network.is_file()
    content = read_checkpoint(whole.checkpoint)
    assert {"net_feat", "net_vp", "epoch"} <= set(content)  # the authors' names
    assert sorted(p.name for p in whole.network.parent.iterdir()) == [
        "checkpoint.pt", "curves.jsonl", "posecontrast.onnx",
    ]  # fmt: skip


def test_the_same_seed_gives_the_same_curve_and_another_does_not(
    labels: Path, whole: TrainingReport, tmp_path: Path
) -> None:
    again = run(labels, tmp_path / "again", epochs=1, workers=1, validation=labels)
    assert again.epochs == whole.epochs[:1]
    assert run(labels, tmp_path / "other", epochs=1, seed=1).epochs[0]["loss"] != again.epochs[0]["loss"]


def test_resumed_equals_uninterrupted(labels: Path, whole: TrainingReport, tmp_path: Path) -> None:
    run(labels, tmp_path, epochs=1, validation=labels)
    resumed = run(labels, tmp_path, resume=True, validation=labels)
    assert resumed.epochs == whole.epochs
    a, b = read_checkpoint(resumed.checkpoint), read_checkpoint(whole.checkpoint)
    for part in ("net_feat", "net_vp"):
        assert all(torch.equal(v, b[part][k]) for k, v in a[part].items())
    done = run(labels, tmp_path, resume=True, validation=labels)  # nothing is left to do
    assert done.epochs == whole.epochs and done.validation == resumed.validation


def test_interrupted_within_an_epoch(labels: Path, whole: TrainingReport, tmp_path: Path) -> None:
    def stop(done: int, total: int) -> None:
        assert total == 6
        if done == 5:
            raise KeyboardInterrupt

    options = TrainingOptions(data=labels, out=tmp_path, init="random", epochs=3, validation=labels)
    with pytest.raises(KeyboardInterrupt):
        train(options, stop, TINY)
    assert len((tmp_path / "curves.jsonl").read_text().splitlines()) == 2
    assert run(labels, tmp_path, resume=True, validation=labels).epochs == whole.epochs


def test_what_cannot_be_resumed_or_overwritten(labels: Path, whole: TrainingReport, tmp_path: Path) -> None:
    out = whole.checkpoint.parent
    with pytest.raises(InputError, match="--resume"):
        run(labels, out)
    with pytest.raises(InputError, match="leave out --resume"):
        run(labels, tmp_path / "none", resume=True)
    with pytest.raises(InputError, match="other seed"):
        run(labels, out, resume=True, seed=9)
    with pytest.raises(InputError, match="other data"):
        run(write_photos(tmp_path / "more", 6), out, resume=True)
    torch.save({"format": 1}, tmp_path / "checkpoint.pt")
    with pytest.raises(InputError, match="damaged"):
        run(labels, tmp_path, resume=True)


def test_it_learns_a_small_set_by_heart(labels: Path) -> None:
    network = TINY.network(0)
    network.train()
    optimiser = torch.optim.Adam(network.parameters(), 1e-2)
    (batch,) = training_batches(training_labels(labels), 8, 0, 1, 2)
    for step in range(60):
        loss, parts, errors = loss_of(network, batch, TINY)
        if not step:
            before = parts["loss"]
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
    assert parts["loss"] < 0.35 * before
    assert (errors <= 15).mean() > 0.9


def test_the_copies_are_classified_and_only_the_query_is_contrasted(labels: Path) -> None:
    network = TINY.network(0)
    (batch,) = training_batches(training_labels(labels), 8, 0, 1, 2)
    _, parts, errors = loss_of(network, batch, TINY)
    assert errors.shape == (24,)
    other = replace(batch, images=batch.images.copy())
    other.images[3] = 0
    _, changed, _ = loss_of(network, other, TINY)
    assert changed["angle_loss"] == parts["angle_loss"] and changed["contrast_loss"] != parts["contrast_loss"]
    _, without, _ = loss_of(network, batch, replace(TINY, contrast=0.0))
    assert without["loss"] == without["angle_loss"] == pytest.approx(parts["angle_loss"])


def test_which_labels_are_used(tmp_path: Path) -> None:
    base = {"photo": "a.png", "category": "car", "azimuth": 0, "elevation": 0}
    path = tmp_path / "labels.json"

    def write(*changes: dict[str, object]) -> Path:
        path.write_text(json.dumps([base | change for change in changes]))
        return path

    odd: tuple[dict[str, object], ...] = (
        {"elevation": 90},
        {"difficult": True},
        {"split": "test"},
        {"elevation": None},
    )
    used = training_labels(write({}, *odd, {"split": "train", "occluded": True}))
    assert [label.split for label in used] == [None, "train"]
    with pytest.raises(InputError, match="1 labels can be trained on"):
        training_labels(write({}, *odd))
    measured = validation_labels(write({"occluded": True}, {"truncated": True}, {"split": "train"}, *odd))
    assert [label.split for label in measured] == [None, "test"]
    with pytest.raises(InputError, match="nothing to measure on"):
        validation_labels(write({"split": "train"}))


def test_a_photo_that_cannot_be_read_is_named(labels: Path, tmp_path: Path) -> None:
    bad = write_photos(tmp_path / "bad")
    (tmp_path / "bad" / "5.png").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"5\.png"):
        run(bad, tmp_path / "out")
    assert not list((tmp_path / "out").iterdir())


def test_a_folder_that_cannot_be_made_is_told_before_the_first_epoch(labels: Path, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine")
    for out in (tmp_path / "file", tmp_path / "file" / "out"):
        with pytest.raises(OSError, match="file"):
            train(
                TrainingOptions(out=out, data=labels, init="random"),
                lambda *_: pytest.fail("a step was done"),
                TINY,
            )


def test_every_photo_is_seen_once_an_epoch_in_another_order(
    labels: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    chosen = training_labels(labels)

    def order(epoch: int) -> list[list[int]]:
        batches = list(training_batches(chosen, 3, 0, epoch, 2))
        assert [b.images.shape[1] for b in batches] == [3, 3]  # the incomplete one is left out
        return [sorted(row.tolist()) for b in batches for row in b.labels[0]]

    first = order(1)
    assert len({tuple(row) for row in first}) == 6
    assert first == order(1) != order(2)


def test_the_exported_network_is_torchs(tmp_path: Path) -> None:
    network = TINY.network(7)
    network.train()
    assert export_onnx(network, tmp_path / "a.onnx") <= 1e-4
    assert network.training
    session = onnxruntime.InferenceSession(str(tmp_path / "a.onnx"))
    images = np.random.default_rng(3).integers(0, 256, (5, 224, 224, 3), np.uint8)
    found = session.run(list(OUTPUTS), {"images": images})
    with torch.no_grad():
        wanted = network.eval()(normalised(torch.from_numpy(images)))
    for a, b in zip(found, (*wanted.logits, *wanted.offsets), strict=True):
        np.testing.assert_allclose(a, b.numpy(), atol=1e-4)


def test_checkpoints_are_exported_and_estimate(
    whole: TrainingReport, labels: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert export(str(whole.checkpoint), tmp_path / "net.onnx") <= 1e-4
    assert (tmp_path / "net.onnx").read_bytes() == whole.network.read_bytes()
    monkeypatch.setattr("cadpose.training.posecontrast.train.RECIPE", TINY)
    torch.save(authors_content(TINY.network(3)), tmp_path / "ckpt.pth")
    export(str(tmp_path / "ckpt.pth"), tmp_path / "theirs.onnx")
    torch.save({"state_dict": TINY.network(3).net_feat.state_dict()}, tmp_path / "encoder.pth")
    with pytest.raises(InputError, match="without heads"):
        export(str(tmp_path / "encoder.pth"), tmp_path / "none.onnx")

    label = training_labels(labels)[0]
    assert label.box is not None
    crop = crop_square(read_photo(label.photo).rgb, label.box, fill=0)
    found = PoseContrastEstimator(tmp_path / "net.onnx").estimate(crop)
    session = onnxruntime.InferenceSession(str(tmp_path / "net.onnx"))
    outputs = session.run(list(OUTPUTS), {"images": np.stack([crop, crop[:, ::-1]])})
    angles = decode(outputs[:3], outputs[3:])
    first = found[0].rotation
    either = [angles[0].tolist(), [(360 - angles[1][0]) % 360, angles[1][1], -angles[1][2]]]
    told = [first.azimuth, first.elevation, first.inplane]
    assert any(np.allclose(told, e, atol=1e-3) for e in either)
    assert encode_angles(*told).bins.shape == (1, 3)


@pytest.mark.parametrize(
    "change",
    [
        {"blocks": ["a", 1, 1, 1]},
        {"blocks": [1, 1]},
        {"blocks": [1, 1, 1, 10**9]},
        {"width": -3},
        {"width": 10**9},
        {"hidden": []},
        {"hidden": [10**9]},
        {"hidden": None},
    ],
)
def test_a_checkpoint_that_tells_of_absurd_layers_is_refused(change: dict[str, Any], tmp_path: Path) -> None:
    settings = {"blocks": [1, 1, 1, 1], "width": 4, "hidden": [16]} | change
    torch.save({"settings": settings, "net_feat": {}, "net_vp": {}}, tmp_path / "a.pt")
    with pytest.raises(InputError, match=r"a\.pt"):
        export(str(tmp_path / "a.pt"), tmp_path / "a.onnx")
    assert not (tmp_path / "a.onnx").exists()
