from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from torch import Tensor

from cadpose.geometry.angles import rotation_from_angles
from cadpose.rotation.bins import BINS
from cadpose.training.lite.objective import Targets, contrast, pose_loss, rotations

ANGLES = st.tuples(st.floats(-360, 360), st.floats(-90, 90), st.floats(-180, 180))


@given(st.lists(ANGLES, min_size=1, max_size=4))
def test_rotations_are_those_of_the_geometry(angles: list[tuple[float, float, float]]) -> None:
    told = np.array(angles)
    found = rotations(torch.from_numpy(told)).numpy()
    np.testing.assert_allclose(found, rotation_from_angles(*told.T), atol=1e-9)


@pytest.fixture
def answers() -> tuple[list[Tensor], list[Tensor], Tensor]:
    rng = torch.Generator().manual_seed(4)
    logits = [3.0 * torch.randn((5, n), generator=rng) for n in BINS]
    offsets = [torch.rand((5, n), generator=rng) for n in BINS]
    return logits, offsets, torch.randn((5, 16), generator=rng)


def targets(azimuth: Tensor, turns: int, elevation: float = 12.0) -> Targets:
    angles = torch.stack([azimuth, torch.full((5,), elevation), torch.full((5,), -3.0)], dim=1)
    return Targets(angles, torch.full((5,), turns))


AZIMUTH = torch.tensor([3.0, 50.0, 100.0, 200.0, 333.0])


@pytest.mark.parametrize("turns", [2, 3, 4, 6, 8])
def test_azimuths_that_look_the_same_cost_the_same(
    answers: tuple[list[Tensor], list[Tensor], Tensor], turns: int
) -> None:
    logits, offsets, q = answers
    one, other = targets(AZIMUTH, turns), targets(AZIMUTH + 360.0 / turns, turns)
    plain = pose_loss(logits, offsets, targets(AZIMUTH + 360.0 / turns, 1))
    assert pose_loss(logits, offsets, one) == pytest.approx(
        float(pose_loss(logits, offsets, other)), rel=1e-4
    )
    assert abs(pose_loss(logits, offsets, one) - plain) > 0.05
    # The second of a pair is compared as it stands, so all turn by the same.
    k = q.flip(1)
    assert contrast(q, k, one) == pytest.approx(float(contrast(q, k, other)), abs=1e-4)


def test_bodies_of_revolution_ignore_the_azimuth(
    answers: tuple[list[Tensor], list[Tensor], Tensor],
) -> None:
    logits, offsets, _ = answers
    one, other = (pose_loss(logits, offsets, targets(a, 0)) for a in (AZIMUTH, AZIMUTH.flip(0) + 77.0))
    assert float(one) == pytest.approx(float(other), rel=1e-6)
    assert float(one) != pytest.approx(float(pose_loss(logits, offsets, targets(AZIMUTH, 0, 55.0))), rel=1e-3)
    logits[0].requires_grad_()
    pose_loss(logits, offsets, targets(AZIMUTH, 0)).backward()  # type: ignore[no-untyped-call]
    assert logits[0].grad is not None and float(logits[0].grad.abs().max()) == 0.0


def test_a_right_answer_costs_nothing_and_a_wrong_one_much() -> None:
    # Labels: 360 - azimuth, elevation + 90, in-plane + 180.
    truth = targets(torch.full((5,), 357.5), 1, 7.5)
    logits = [torch.full((5, n), -50.0) for n in BINS]
    offsets = [torch.zeros((5, n)) for n in BINS]
    for i, label in enumerate((2.5, 97.5, 177.0)):
        logits[i][:, int(label // 15)] = 50.0
        offsets[i][:, int(label // 15)] = label / 15 % 1
    assert float(pose_loss(logits, offsets, truth)) == pytest.approx(0.0, abs=1e-5)
    logits[0] = logits[0].roll(3, dims=1)
    assert float(pose_loss(logits, offsets, truth)) > 50.0


def test_contrast_knows_equivalent_poses() -> None:
    """Objects half a turn apart that look the same after half a turn do not repel each other."""
    angles = torch.tensor([[10.0, 5.0, 0.0], [190.0, 5.0, 0.0]])
    q = k = torch.eye(2)
    same = contrast(q, k, Targets(angles, torch.tensor([2, 2])))
    apart = contrast(q, k, Targets(angles, torch.tensor([1, 1])))
    assert float(same) == pytest.approx(0.0, abs=1e-3) and float(apart) > 0.05
