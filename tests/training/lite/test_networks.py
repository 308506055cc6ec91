from __future__ import annotations

import numpy as np
import pytest
import torch

from cadpose.rotation.bins import BINS, probabilities
from cadpose.training.lite.networks import EmbeddedNetworks, averaged, shrunk
from tests.training.lite.made import CATEGORIES


def test_members_are_averaged_as_the_estimator_does() -> None:
    rng = np.random.default_rng(0)
    logits = [rng.normal(0, 3, (2, 1, n)) for n in BINS]  # two members, one crop
    offsets = [rng.uniform(0, 1, (2, 1, n)) for n in BINS]
    answers = [
        ([torch.from_numpy(x[m]) for x in logits], [torch.from_numpy(x[m]) for x in offsets], torch.empty(0))
        for m in range(2)
    ]
    logs, told = averaged(answers)
    for i in range(3):
        share = probabilities(logits[i])
        mean = share.mean(axis=0)
        np.testing.assert_allclose(logs[i].exp().numpy(), mean, rtol=1e-4)
        # As rotation.network.RotationNetwork.look has it.
        expected = (share * offsets[i]).sum(axis=0) / (2 * mean)
        np.testing.assert_allclose(told[i].numpy(), expected, rtol=1e-4)


def test_none_touches_the_weights_of_another() -> None:
    pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")
    networks = EmbeddedNetworks(CATEGORIES, pretrained=False)
    cells = [torch.zeros(2, 196, 112), torch.zeros(2, 49, 192)]
    _, head = networks(torch.zeros(2, 3, 224, 224), cells, torch.zeros(2, 2))
    sum(logit.sum() for logit in head[0]).backward()
    touched = {name.partition(".")[0] for name, p in networks.named_parameters() if p.grad is not None}
    assert touched == {"head"}
    groups = networks.parameter_groups(1.0, 0.5)
    counted = sum(len(group["params"]) for group in groups)  # type: ignore[arg-type, misc]
    assert counted == len(list(networks.parameters())) and networks.categories == CATEGORIES


def test_crops_are_halved() -> None:
    images = torch.arange(16.0).reshape(1, 1, 4, 4)
    assert shrunk(images)[0, 0].tolist() == [[2.5, 4.5], [10.5, 12.5]]
