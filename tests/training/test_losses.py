"""The losses against the formulas, written out in numpy with loops."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
import torch

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.rotation.bins import BINS
from cadpose.training.losses import angle_loss, geodesic_shares, pose_aware_nce

WEIGHTS: dict[str, Callable[[float], float]] = {
    "linear": lambda d: d / 180,
    "square": lambda d: (d / 180) ** 2,
    "sqrt": lambda d: math.sqrt(d / 180),
    "sin": lambda d: abs(math.sin(d / 180 * math.pi)),
}


@pytest.fixture
def sample() -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(5)
    angles = rng.uniform(0, 360, 6), rng.uniform(-90, 90, 6), rng.uniform(-180, 180, 6)
    return rng.normal(size=(6, 9)), rng.normal(size=(6, 9)), rotation_from_angles(*angles)


def unit(features: FloatArray) -> FloatArray:
    return np.asarray(features / np.linalg.norm(features, axis=1, keepdims=True))


@pytest.mark.parametrize("weighting", WEIGHTS)
@pytest.mark.parametrize("temperature", [0.5, 0.1])
def test_pose_aware_nce_is_the_formula(
    sample: tuple[FloatArray, ...], weighting: str, temperature: float
) -> None:
    q, k, R = sample
    total = 0.0
    for i in range(6):
        positive = math.exp(unit(q)[i] @ unit(k)[i] / temperature)
        negative = sum(
            WEIGHTS[weighting](float(geodesic_degrees(R[i], R[j])))
            * math.exp(unit(q)[i] @ unit(q)[j] / temperature)
            for j in range(6)
            if j != i
        )
        total -= math.log(positive / (positive + negative))
    tensors = [torch.from_numpy(a) for a in sample]
    found = pose_aware_nce(tensors[0], tensors[1], tensors[2], weighting, temperature)
    assert float(found) == pytest.approx(total / 6, rel=1e-9)


def test_shares_are_the_geodesic(sample: tuple[FloatArray, ...]) -> None:
    R = sample[2]
    found = geodesic_shares(torch.from_numpy(R)).numpy()
    np.testing.assert_allclose(
        found * 180, geodesic_degrees(R[:, None], R[None]) * (1 - np.eye(6)), atol=1e-9
    )


def test_equal_poses_do_not_repel() -> None:
    rng = np.random.default_rng(0)
    q = torch.from_numpy(rng.normal(size=(5, 4))).requires_grad_()
    k = torch.from_numpy(rng.normal(size=(5, 4)))
    same = torch.eye(3, dtype=torch.float64).expand(5, 3, 3)
    assert float(pose_aware_nce(q, k, same).detach()) == pytest.approx(0.0, abs=1e-6)
    opposite = torch.from_numpy(rotation_from_angles([0, 180, 0, 180, 0], 0))
    assert float(pose_aware_nce(q, k, opposite).detach()) > 0.5
    pose_aware_nce(q, k, opposite, "sqrt").backward()  # type: ignore[no-untyped-call]
    assert q.grad is not None and torch.isfinite(q.grad).all() and float(q.grad.abs().max()) > 0


def test_length_of_features_does_not_matter(sample: tuple[FloatArray, ...]) -> None:
    q, k, R = (torch.from_numpy(a) for a in sample)
    assert float(pose_aware_nce(7 * q, 0.1 * k, R)) == pytest.approx(float(pose_aware_nce(q, k, R)))


def test_angle_loss_is_the_formula() -> None:
    rng = np.random.default_rng(2)
    logits = [rng.normal(size=(4, k)) for k in BINS]
    offsets = [rng.normal(size=(4, k)) for k in BINS]
    labels = np.array([[0, 0, 0], [359, 179, 359], [44, 91, 180], [15, 16, 17]])
    total, huber = 0.0, []
    for i in range(3):
        for n in range(4):
            b = labels[n, i] // 15
            total -= (logits[i][n, b] - math.log(np.exp(logits[i][n]).sum())) / 4
            off = abs(5 * offsets[i][n, b] - 5 * (labels[n, i] % 15) / 15)
            huber.append(off**2 / 2 if off < 1 else off - 0.5)
    total += float(np.mean(huber))
    found = angle_loss(
        [torch.from_numpy(a) for a in logits],
        [torch.from_numpy(a) for a in offsets],
        torch.from_numpy(labels),
    )
    assert float(found) == pytest.approx(total, rel=1e-9)


def test_what_is_refused(sample: tuple[FloatArray, ...]) -> None:
    q, k, R = (torch.from_numpy(a) for a in sample)
    with pytest.raises(ValueError, match="linear, square, sqrt, sin"):
        pose_aware_nce(q, k, R, "cubic")
    with pytest.raises(ValueError, match="rotations"):
        pose_aware_nce(q, k, R[:3])
    with pytest.raises(ValueError, match="features"):
        pose_aware_nce(q, k[:3], R)
