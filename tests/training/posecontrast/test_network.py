from __future__ import annotations

import numpy as np
import pytest
import torch

from cadpose.rotation.bins import BINS
from cadpose.training.posecontrast.network import MEAN, STD, PoseContrast, normalised


def parameters(module: torch.nn.Module) -> int:
    return sum(p.numel() for p in module.parameters())


@pytest.fixture(scope="module")
def full() -> PoseContrast:
    with torch.device("meta"):  # names and shapes without memory
        return PoseContrast()


def test_the_published_network_has_the_published_size(full: PoseContrast) -> None:
    assert parameters(full.net_feat) == 23_508_032
    assert parameters(full.net_vp) == 2_066_720


def test_names_and_shapes_are_those_of_resnet50(full: PoseContrast) -> None:
    shapes = {k: tuple(v.shape) for k, v in full.net_feat.state_dict().items()}
    assert len(shapes) == 318
    assert shapes["conv1.weight"] == (64, 3, 7, 7)
    assert shapes["layer1.0.downsample.0.weight"] == (256, 64, 1, 1)
    assert shapes["layer3.5.conv2.weight"] == (256, 256, 3, 3)
    assert shapes["layer4.0.downsample.1.running_var"] == (2048,)
    assert shapes["layer4.2.bn3.weight"] == (2048,)
    # The stride is in the 3x3 convolution.
    assert full.net_feat.layer2[0].conv2.stride == (2, 2) and full.net_feat.layer2[0].conv1.stride == (1, 1)
    head = {k: tuple(v.shape) for k, v in full.net_vp.state_dict().items() if "running" not in k}
    assert head["compress.0.weight"] == (800, 2048) and head["compress.6.weight"] == (200, 400)
    assert head["compress.7.bias"] == (200,)
    assert [head[f"fc_{kind}_{a}.weight"][0] for kind in ("cls", "reg") for a in ("azi", "ele", "inp")] == [
        24, 12, 24, 24, 12, 24,
    ]  # fmt: skip


def test_what_it_answers() -> None:
    net = PoseContrast((1, 1, 1, 1), 8, (16, 16, 8)).eval()
    out = net(torch.zeros(2, 3, 224, 224))
    assert out.features.shape == (2, 256) == (2, net.net_feat.channels)
    assert [tuple(o.shape) for o in (*out.logits, *out.offsets)] == [(2, k) for k in BINS] * 2


def test_normalisation() -> None:
    rng = np.random.default_rng(0)
    images = rng.integers(0, 256, (2, 5, 7, 3), np.uint8)
    wanted = (
        images.astype(np.float64).transpose(0, 3, 1, 2) / 255 - np.reshape(MEAN, (3, 1, 1))
    ) / np.reshape(STD, (3, 1, 1))
    np.testing.assert_allclose(normalised(torch.from_numpy(images)).numpy(), wanted, atol=1e-6)


@pytest.mark.slow
def test_one_pass_of_the_published_network() -> None:
    net = PoseContrast().eval()
    with torch.no_grad():
        out = net(torch.zeros(1, 3, 224, 224))
    assert out.features.shape == (1, 2048) and torch.isfinite(out.logits[0]).all()
