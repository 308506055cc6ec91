from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from torch import Tensor

from cadpose import weights
from cadpose.errors import DependencyError, InputError
from cadpose.training.triplet.loading import IMAGENET, load_initial
from cadpose.training.triplet.network import TwoEncoders, Vgg16


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "weights"


def torchvisions(width: int, seed: int = 3) -> dict[str, Tensor]:
    """As torchvision's file: the convolutions and a classifier."""
    torch.manual_seed(seed)
    return {
        **Vgg16(width).state_dict(),
        "classifier.0.weight": torch.zeros(4, 4),
        "classifier.0.bias": torch.zeros(4),
    }


def equals(network: TwoEncoders, content: dict[str, Tensor]) -> bool:
    return all(
        torch.equal(value, content[key])
        for encoder in (network.photo, network.render)
        for key, value in encoder.state_dict().items()
    )


def test_imagenets_weights_for_both_encoders(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    content = torchvisions(2)
    cache.mkdir(parents=True)
    file = cache / "vgg16-397923af.pth"
    # PyTorch's old format, as the published file has it.
    torch.save(content, file, _use_new_zipfile_serialization=False)
    data = file.read_bytes()
    entry = replace(weights.REGISTRY[IMAGENET], size=len(data), sha256=hashlib.sha256(data).hexdigest())
    monkeypatch.setitem(weights.REGISTRY, IMAGENET, entry)
    network = TwoEncoders(2)
    assert not equals(network, content)
    load_initial(network, "imagenet")
    assert equals(network, content)


def test_offline_the_address_and_the_place_are_told(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    entry = replace(weights.REGISTRY[IMAGENET], url="http://127.0.0.1:9/vgg16-397923af.pth")
    monkeypatch.setitem(weights.REGISTRY, IMAGENET, entry)
    network = TwoEncoders(1)
    with pytest.raises(DependencyError) as caught:
        load_initial(network, "imagenet")
    told = str(caught.value)
    assert entry.url in told and str(cache / entry.file) in told and "\n" not in told


def test_a_file_of_ones_own(tmp_path: Path) -> None:
    content = torchvisions(2)
    for whole in (content, {"state_dict": content, "epoch": 3}):
        torch.save(whole, tmp_path / "vgg.pth")
        network = TwoEncoders(2)
        load_initial(network, str(tmp_path / "vgg.pth"))
        assert equals(network, content)


def test_an_earlier_training(tmp_path: Path) -> None:
    source, network = TwoEncoders(2), TwoEncoders(2)
    with torch.no_grad():
        next(source.photo.parameters()).mul_(2)
    torch.save({"photo": source.photo.state_dict(), "render": source.render.state_dict()}, tmp_path / "c.pt")
    load_initial(network, str(tmp_path / "c.pt"))
    assert all(torch.equal(v, source.state_dict()[k]) for k, v in network.state_dict().items())


def test_what_does_not_fit_names_the_parameter(tmp_path: Path) -> None:
    path, network, content = tmp_path / "vgg.pth", TwoEncoders(2), torchvisions(2)

    def refused(changed: object, match: str) -> None:
        torch.save(changed, path)
        with pytest.raises(InputError, match=match):
            load_initial(network, str(path))

    short = {key: value for key, value in content.items() if key != "features.28.bias"}
    refused(short, r"vgg\.pth: is not a checkpoint of this network, it has no features\.28\.bias")
    refused({f"module.{key}": value for key, value in content.items()}, r"no features\.0\.weight")
    refused(
        torchvisions(3), r"features\.0\.weight has shape \(3, 3, 3, 3\), this network's has \(2, 3, 3, 3\)"
    )
    refused(content | {"features.0.bias": torch.full((2,), torch.nan)}, "not numbers")
    refused([1], "no dictionary")
    with pytest.raises(InputError, match=r"none\.pth"):
        load_initial(network, str(tmp_path / "none.pth"))


def test_random_leaves_the_weights_alone() -> None:
    network = TwoEncoders(2)
    before = {key: value.clone() for key, value in network.state_dict().items()}
    load_initial(network, "random")
    assert all(torch.equal(value, before[key]) for key, value in network.state_dict().items())
