from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch.nn import functional

from cadpose.training.triplet.loss import distances, triplet_losses


def by_hand(photo: np.ndarray, positive: np.ndarray, negatives: np.ndarray, margin: float) -> list[float]:
    found = []
    for negative in negatives:
        near = float(np.sqrt(((photo - positive) ** 2).sum()))
        far = float(np.sqrt(((photo - negative) ** 2).sum()))
        found.append(max(0.0, near - far + margin))
    return found


@given(st.integers(0, 2**32), st.integers(1, 12), st.floats(0.01, 2.0))
def test_it_is_what_a_person_writes_down(seed: int, count: int, margin: float) -> None:
    rng = np.random.default_rng(seed)
    vectors = rng.normal(size=(2 + count, 16))
    vectors /= np.linalg.norm(vectors, axis=1, keepdims=True)
    photo, renders = torch.from_numpy(vectors[:1]), torch.from_numpy(vectors[1:])
    found = triplet_losses(distances(photo, renders), margin)
    wanted = by_hand(vectors[0], vectors[1], vectors[2:], margin)
    np.testing.assert_allclose(found.numpy(), wanted, atol=1e-5)
    # And what torch has of its own.
    own = functional.triplet_margin_loss(
        photo.expand(count, -1), renders[:1].expand(count, -1), renders[1:], margin, reduction="none"
    )
    torch.testing.assert_close(found, own)


def test_a_far_negative_pulls_at_nothing() -> None:
    photo = torch.tensor([[1.0, 0.0]], requires_grad=True)
    renders = torch.tensor([[0.9, 0.1], [-1.0, 0.0], [0.8, 0.0]])
    losses = triplet_losses(distances(photo, renders), 0.3)
    assert losses[0] == 0 and losses[1] > 0
    losses[0].backward()  # type: ignore[no-untyped-call]
    assert photo.grad is not None and not photo.grad.any()


def test_features_alike_have_a_slope() -> None:
    photo = torch.ones(1, 4, requires_grad=True)
    triplet_losses(distances(photo, torch.ones(2, 4)), 0.3).sum().backward()  # type: ignore[no-untyped-call]
    assert photo.grad is not None and torch.isfinite(photo.grad).all()


def test_a_positive_alone_is_no_triplet() -> None:
    with pytest.raises(ValueError, match="negatives"):
        triplet_losses(torch.zeros(1), 0.3)
