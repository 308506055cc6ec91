from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.records import Rotation, RotationHypothesis
from cadpose.similarity.joint.bracket import FOLLOWED, RADIUS, Bracket

_ANGLES = np.array([(a, e, 0.0) for e in (0.0, 15.0, 30.0) for a in range(0, 360, 10)])
VIEWS = rotation_from_angles(*_ANGLES.T)


def guess(azimuth: float, elevation: float = 12.0, probability: float = 0.9) -> RotationHypothesis:
    return RotationHypothesis(Rotation(azimuth, elevation), 1.0, probability)


def test_views_about_the_first_hypotheses_are_tried() -> None:
    bracket = Bracket.about([guess(40), guess(220), guess(130), guess(300)], VIEWS)
    away = geodesic_degrees(bracket.rotations[:, None], bracket.hypotheses[None])
    assert len(bracket.hypotheses) == FOLLOWED and (away.min(axis=1) <= RADIUS).all()
    chosen = _ANGLES[bracket.near]
    assert {40.0, 220.0, 130.0} < set(chosen[:, 0]) and 300.0 not in chosen[:, 0]
    np.testing.assert_array_equal(bracket.rotations, VIEWS[bracket.near])


def test_unlikely_and_far_views_cost_more() -> None:
    bracket = Bracket.about([guess(40, probability=0.9), guess(220, probability=0.05)], VIEWS)
    cost = {tuple(_ANGLES[n, :2]): c for n, c in zip(bracket.near, bracket.cost, strict=True)}
    assert 0.0 < cost[40.0, 15.0] < cost[50.0, 15.0] < cost[60.0, 15.0]
    assert cost[220.0, 15.0] > cost[40.0, 15.0] + 0.05


def test_where_no_view_is_near_the_nearest_are_tried() -> None:
    bracket = Bracket.about([RotationHypothesis(Rotation(40, 85, 120), 1.0, 0.5)], VIEWS)
    assert len(bracket.near) == 6
    with pytest.raises(ValueError, match="hypothesis"):
        Bracket.about([], VIEWS)


@given(st.floats(0, 359), st.floats(3, 27), st.floats(-9, 9))
def test_scores_that_peak_at_a_rotation_settle_near_it(azimuth: float, elevation: float, off: float) -> None:
    truth = rotation_from_angles(azimuth, elevation, 0.0)
    bracket = Bracket.about([guess(azimuth + off, elevation)], VIEWS)
    settled = bracket.settled(0.5 - 0.01 * geodesic_degrees(truth, bracket.rotations))
    assert np.linalg.det(settled) == pytest.approx(1.0) and settled @ settled.T == pytest.approx(np.eye(3))
    assert geodesic_degrees(settled, truth) <= 0.5 * abs(off) + 4.0


def test_far_from_all_hypotheses_the_scores_alone_decide() -> None:
    bracket = Bracket(
        rotation_from_angles(np.array([0.0]), np.array([0.0]), np.array([0.0])),
        np.arange(2),
        rotation_from_angles(np.array([60.0, 70.0]), np.zeros(2), np.zeros(2)),
        np.zeros(2),
    )
    settled = bracket.settled(np.array([0.5, 0.5]))
    assert geodesic_degrees(settled, rotation_from_angles(65.0, 0.0, 0.0)) < 0.01
