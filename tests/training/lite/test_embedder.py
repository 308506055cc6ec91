from __future__ import annotations

import math

import pytest
import torch
from torch.nn import functional

from cadpose.training.lite.embedder import (
    _KEPT,
    _TEMPERATURE,
    SIDE,
    WIDTH,
    Embedder,
    RenderQueue,
    first_share,
    matching_loss,
)


def unit(*rows: tuple[float, ...]) -> torch.Tensor:
    return functional.normalize(torch.tensor(rows), dim=1)


def test_embeddings_are_of_unit_length() -> None:
    pytest.importorskip("efficientnet_lite_pytorch", reason="needs cadpose[train]")
    torch.manual_seed(0)
    embedder = Embedder(pretrained=False).eval()
    with torch.no_grad():
        found = embedder(torch.randn(2, 3, SIDE, SIDE))
    assert found.shape == (2, WIDTH)
    torch.testing.assert_close(found.norm(dim=1), torch.ones(2))
    assert [g["lr"] for g in embedder.parameter_groups(1.0, 0.5)] == [0.5, 1.0]
    assert sum(p.numel() for p in embedder.parameters()) < 2_200_000


def test_the_loss_of_two_models_by_hand() -> None:
    photos, renders = unit((1.0, 0.0), (1.0, 0.2)), unit((1.0, 0.1), (1.0, 0.3))
    likeness = photos @ renders.T / _TEMPERATURE
    expected = 0.0
    for rows in (likeness, likeness.T):
        expected += sum(-math.log(float(rows[i].softmax(0)[i])) for i in range(2)) / 4
    found = matching_loss(photos, renders, torch.tensor([0, 1]), RenderQueue())
    assert float(found) == pytest.approx(expected, rel=1e-4)


def test_other_views_of_the_same_model_are_neither_right_nor_wrong() -> None:
    photos, renders = unit((1.0, 0.0), (1.0, 0.1)), unit((1.0, 0.2), (1.0, 0.3))
    alike = matching_loss(photos, renders, torch.tensor([4, 4]), RenderQueue())
    assert float(alike) == pytest.approx(0.0, abs=1e-6)
    assert float(matching_loss(photos, renders, torch.tensor([4, 5]), RenderQueue())) > 0.5


def test_renders_of_batches_before_are_negatives_until_they_are_old() -> None:
    queue = RenderQueue()
    photos, renders, models = unit((1.0, 0.0)), unit((1.0, 0.1)), torch.tensor([7])
    assert float(matching_loss(photos, renders, models, queue)) == pytest.approx(0.0, abs=1e-6)
    # The same model is kept: still no negative. Another, as near, is.
    assert float(matching_loss(photos, renders, models, queue)) == pytest.approx(0.0, abs=1e-6)
    queue.add(renders, torch.tensor([8]))
    assert float(matching_loss(photos, renders, models, queue)) > 0.3
    for _ in range(_KEPT):
        queue.add(renders, models)
    assert float(matching_loss(photos, renders, models, queue)) == pytest.approx(0.0, abs=1e-6)


def test_the_nearest_model_of_the_category() -> None:
    photos = unit((1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
    renders = unit((1.0, 0.1), (1.0, 0.0), (0.9, 1.0))
    models, category = torch.tensor([0, 1, 2]), torch.tensor([0, 0, 1])
    # The second photo is nearer to the third render, which is of another category; of its own the first is
    # nearer, which is another model's. The first photo is nearest to the second model's render.
    assert first_share(photos, renders, models, category) == pytest.approx(1 / 3)
