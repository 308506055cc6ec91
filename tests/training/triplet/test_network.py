from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import torch

from cadpose.similarity.triplet_framing import Framing
from cadpose.training.triplet.network import TwoEncoders, Vgg16
from cadpose.training.triplet.recipe import RECIPE, Recipe


def test_names_and_shapes_are_torchvisions() -> None:
    with torch.device("meta"):
        found = {key: tuple(value.shape) for key, value in Vgg16().state_dict().items()}
    # torchvision's "features", without batch norm: place of each convolution, inputs and outputs.
    convolutions = (
        (0, 3, 64), (2, 64, 64),
        (5, 64, 128), (7, 128, 128),
        (10, 128, 256), (12, 256, 256), (14, 256, 256),
        (17, 256, 512), (19, 512, 512), (21, 512, 512),
        (24, 512, 512), (26, 512, 512), (28, 512, 512),
    )  # fmt: skip
    wanted: dict[str, tuple[int, ...]] = {}
    for i, inputs, outputs in convolutions:
        wanted |= {f"features.{i}.weight": (outputs, inputs, 3, 3), f"features.{i}.bias": (outputs,)}
    assert found == wanted
    assert sum(int(np.prod(shape)) for shape in found.values()) == 14_714_688


def test_it_is_the_largest_answer_of_conv5_3_brought_to_length_1() -> None:
    torch.manual_seed(1)
    net = Vgg16(2)
    x = torch.rand(3, 3, 32, 48)
    features = net(x)
    assert features.shape == (3, 16)
    torch.testing.assert_close(features.norm(dim=1), torch.ones(3))
    maps = net.features(x)
    assert maps.shape == (3, 16, 2, 3)  # four halvings, the fifth pool is left out
    assert (maps < 0).any()  # and so is the last ReLU
    largest = maps.flatten(2).max(dim=2).values
    torch.testing.assert_close(features, largest / largest.norm(dim=1, keepdim=True))


def test_the_encoders_begin_alike_and_learn_apart() -> None:
    net = TwoEncoders(2)
    images = torch.randint(0, 256, (2, 32, 32, 3), dtype=torch.uint8)
    photo, render = net(images, images)
    assert torch.equal(photo, render)
    with torch.no_grad():
        next(net.photo.parameters()).mul_(-1)
    again, same = net(images, images)
    assert torch.equal(same, render) and not torch.equal(again, photo)


@pytest.mark.parametrize(("count", "first"), [(1, 24), (2, 17), (5, 0)])
def test_only_the_last_blocks_learn(count: int, first: int) -> None:
    net = TwoEncoders(2)
    net.train_blocks(count)
    for encoder in (net.photo, net.render):
        for name, parameter in encoder.named_parameters():
            assert parameter.requires_grad == (int(name.split(".")[1]) >= first), name
    # Training all and then fewer must not leave any thawed.
    net.train_blocks(5)
    net.train_blocks(1)
    assert len(net.trained()) == 2 * 3 * 2


def test_levels() -> None:
    images = torch.tensor([[[[0, 127, 255]]]], dtype=torch.uint8)
    plain = TwoEncoders(1)._levels(images).flatten()
    torch.testing.assert_close(plain, torch.tensor([0.0, 127 / 255, 1.0]))
    normal = TwoEncoders(1, normalise=True)._levels(images).flatten()
    wanted = (np.array([0.0, 127 / 255, 1.0]) - (0.485, 0.456, 0.406)) / (0.229, 0.224, 0.225)
    np.testing.assert_allclose(normal.numpy(), wanted, atol=1e-6)


def test_the_published_recipe() -> None:
    assert (RECIPE.negatives, RECIPE.mined, RECIPE.rate, RECIPE.batch_size) == (10, 7, 2e-6, 6)
    assert RECIPE.margin**2 == pytest.approx(0.1)
    assert (RECIPE.momentum, RECIPE.weight_decay) == (0.9, 1e-3)
    assert RECIPE.framing == Framing(256, 150, True) and RECIPE.width == 64
    assert RECIPE.trained_blocks == 1 and not RECIPE.normalise
    wrongs: tuple[dict[str, Any], ...] = (
        {"negatives": 0}, {"mined": 11}, {"batch_size": 0}, {"trained_blocks": 6}, {"rate": 0.0},
    )  # fmt: skip
    for wrong in wrongs:
        with pytest.raises(ValueError, match="must be"):
            Recipe(**wrong)
