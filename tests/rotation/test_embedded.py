"""How the network's proposals and the templates' vote become hypotheses."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.errors import LibraryError
from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.rotation import embedded
from cadpose.rotation.bins import BINS
from cadpose.rotation.embedded import FEATURES, EmbeddedRotation, Proposals, fused
from cadpose.rotation.grid import grid_angles, grid_rotations
from cadpose.rotation.network import AngleDistributions
from tests.rotation.test_network import certain

_NONE = SymmetryGroup.trivial()


def blend(a: AngleDistributions, b: AngleDistributions, share: float) -> AngleDistributions:
    shares = tuple(share * x + (1 - share) * y for x, y in zip(a.shares, b.shares, strict=True))
    return AngleDistributions(shares, a.offsets)


def vote_for(azimuth: float, elevation: float, height: float = 0.1) -> np.ndarray:
    distance = geodesic_degrees(rotation_from_angles(azimuth, elevation), grid_rotations())
    return np.asarray(0.3 + height * np.exp(-((distance / 15.0) ** 2)))


def best(found: Proposals) -> np.ndarray:
    return np.asarray(found.R_cv_from_s[0])


def test_where_both_agree_the_answer_is_there() -> None:
    found = fused(certain(40, 10, 0), vote_for(40, 10), _NONE, 5)
    assert geodesic_degrees(best(found), rotation_from_angles(40, 10)) < 4.0


def test_the_vote_decides_between_two_proposals_that_the_network_holds_for_equal() -> None:
    undecided = blend(certain(40, 10, 0), certain(220, 10, 0), 0.5)
    for azimuth in (40, 220):
        found = fused(undecided, vote_for(azimuth, 10), _NONE, 5)
        assert geodesic_degrees(best(found), rotation_from_angles(azimuth, 10)) < 12.0


def test_the_network_decides_where_the_vote_is_flat() -> None:
    found = fused(certain(130, 20, 0), np.full(len(grid_angles()), 0.3), _NONE, 5)
    assert geodesic_degrees(best(found), rotation_from_angles(130, 20)) < 8.0


def test_a_rotation_beyond_the_grid_is_kept_as_the_network_says_it() -> None:
    found = fused(certain(130, 20, 90), np.full(len(grid_angles()), 0.3), _NONE, 5)
    assert geodesic_degrees(best(found), rotation_from_angles(130, 20, 90)) < 1.0


def test_hypotheses_are_apart_and_ordered() -> None:
    undecided = blend(certain(40, 10, 0), certain(220, 10, 0), 0.6)
    found = fused(undecided, vote_for(220, 10), _NONE, 5)
    assert (np.diff(found.scores) <= 0).all()
    R = found.R_cv_from_s
    for i in range(len(R)):
        for j in range(i):
            assert geodesic_degrees(R[i], R[j]) > 12.0  # 25 before each is drawn to its peak
    assert found.features.shape == (len(R), len(FEATURES))
    assert np.isfinite(found.features).all()


def test_rotations_that_look_the_same_are_one_hypothesis() -> None:
    undecided = blend(certain(40, 10, 0), certain(220, 10, 0), 0.5)
    vote = np.maximum(vote_for(40, 10), vote_for(220, 10))
    half_turn = SymmetryGroup.cyclic(2)
    plain, modulo = fused(undecided, vote, _NONE, 2), fused(undecided, vote, half_turn, 2)
    turned = rotation_from_angles(220, 10)
    assert min(geodesic_degrees(R, turned) for R in plain.R_cv_from_s) < 12.0
    errors = half_turn.geodesic_degrees(modulo.R_cv_from_s, np.broadcast_to(turned, modulo.R_cv_from_s.shape))
    assert (np.sort(errors)[:2] > 12.0).sum() >= len(errors) - 1
    # What is left beside it is far less likely, so that the margin is larger.
    assert modulo.features[0, 0] > plain.features[0, 0] + 0.2


def test_disagreement_shows_in_the_features() -> None:
    names = list(FEATURES)
    agree = fused(certain(40, 10, 0), vote_for(40, 10), _NONE, 5).features[0]
    differ = fused(certain(40, 10, 0), vote_for(160, 10), _NONE, 5).features[0]
    assert agree[names.index("apart")] + agree[names.index("grid")] < 0.4
    assert differ[names.index("apart")] + differ[names.index("grid")] > 0.9
    assert agree[names.index("margin")] > differ[names.index("margin")]


def test_bins_are_those_of_the_network() -> None:
    assert [len(s) for s in certain(0, 0, 0).shares] == list(BINS)


def test_without_a_model_there_is_nothing_to_compare_with() -> None:
    estimator = EmbeddedRotation(compare=None, encoder=None)  # type: ignore[arg-type]
    with pytest.raises(LibraryError, match="add models"):
        estimator.propose(np.zeros((224, 224, 3), np.uint8), [])


def one_proposal(inplane: float, likeness: float) -> Proposals:
    features = np.zeros((1, len(FEATURES)))
    features[0, FEATURES.index("likeness")] = likeness
    return Proposals(rotation_from_angles(40, 10, inplane)[None], np.zeros(1), features)


@pytest.mark.parametrize(
    ("first", "second", "likeness", "told", "looks"),
    [
        (25.0, 2.0, 0.4, 27.0, 2),  # looked at again upright, which is more like a template
        (25.0, 2.0, 0.2, 25.0, 2),  # which is less like one
        (-25.0, -1.0, 0.4, -26.0, 2),
        (5.0, 2.0, 0.4, 5.0, 1),  # upright enough
        (90.0, 2.0, 0.4, 90.0, 1),  # fallen over: its rectangle would be another
    ],
)
def test_what_lies_askew_is_looked_at_again(
    monkeypatch: pytest.MonkeyPatch, first: float, second: float, likeness: float, told: float, looks: int
) -> None:
    answers = [one_proposal(first, 0.3), one_proposal(second, likeness)]
    crops: list[np.ndarray] = []

    def look(crop: np.ndarray, cads: object) -> Proposals:
        crops.append(crop)
        return answers[len(crops) - 1]

    estimator = EmbeddedRotation(compare=None, encoder=None, network=object())  # type: ignore[arg-type]
    monkeypatch.setattr(estimator, "_look", look)
    crop = np.full((224, 224, 3), 255, np.uint8)
    crop[100:124, 20:204] = 0
    found = estimator.propose(crop, [None])  # type: ignore[list-item]
    assert geodesic_degrees(best(found), rotation_from_angles(40, 10, told)) < 1e-4
    assert len(crops) == looks
    if looks == 2:
        # Turned back by what was found: a bar that rises to the right comes to lie level.
        ends = [np.flatnonzero(crops[1][:, x].min(axis=1) < 128).mean() for x in (40, 184)]
        assert (ends[1] - ends[0]) * np.sign(first) == pytest.approx(144 * np.tan(np.radians(25)), abs=3)


def test_a_turned_crop_keeps_its_scale() -> None:
    rng = np.random.default_rng(0)
    crop = rng.integers(0, 256, (224, 224, 3), dtype=np.uint8)
    quarter = embedded._turned(crop, 90.0)
    assert np.array_equal(quarter, np.rot90(crop))
