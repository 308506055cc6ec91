"""The shipped network: what it answers has the right form, and mirror images give mirrored answers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.encoder import lite0
from cadpose.errors import DependencyError
from cadpose.geometry.angles import azimuth_error
from cadpose.rotation.bins import BINS, encode_angles
from cadpose.rotation.features import describe
from cadpose.rotation.network import AngleDistributions, RotationNetwork

_SIDE = 224


def certain(azimuth: float, elevation: float, inplane: float) -> AngleDistributions:
    """All probability in the bins of one rotation."""
    coded = encode_angles(azimuth, elevation, inplane)
    shares = tuple(np.eye(n)[coded.bins[0, i]] for i, n in enumerate(BINS))
    offsets = tuple(np.full(n, coded.offsets[0, i]) for i, n in enumerate(BINS))
    return AngleDistributions(shares, offsets)


@given(st.integers(0, 359), st.integers(-89, 89), st.integers(-179, 179))
def test_the_likeliest_triple_is_that_of_the_certain_bins(az: int, el: int, ip: int) -> None:
    angles, chances = certain(az, el, ip).likeliest(3)
    assert chances[0] == pytest.approx(1.0)
    assert azimuth_error(angles[0, 0], az) < 1e-6
    assert abs(angles[0, 1] - el) < 1e-6
    assert azimuth_error(angles[0, 2], ip) < 1e-6


@given(st.integers(0, 359), st.integers(-80, 80), st.integers(-179, 179))
def test_density_is_highest_where_the_probability_is(az: int, el: int, ip: int) -> None:
    there = np.array([[az, el, ip]], float)
    away = np.add(there, [[90.0, 0.0, 0.0]])
    distribution = certain(az, el, ip)
    assert distribution.density(there)[0] > distribution.density(away)[0] + 3.0


def _looked(crop: np.ndarray) -> AngleDistributions:
    both = np.stack([crop, crop[:, ::-1]])
    return RotationNetwork(threads=1).look(both, describe(lite0("cpu", 1), both), "car", (False, True))


def test_the_shipped_network_answers_in_probabilities_and_mirrors_with_the_picture() -> None:
    crop = np.random.default_rng(0).integers(0, 256, (_SIDE, _SIDE, 3), np.uint8)
    own, mirrored = _looked(crop), _looked(np.ascontiguousarray(crop[:, ::-1]))
    for i, (a, b) in enumerate(zip(own.shares, mirrored.shares, strict=True)):
        assert a.shape == (BINS[i],)
        assert a.sum() == pytest.approx(1.0)
        np.testing.assert_allclose(a, b if i == 1 else b[::-1], atol=1e-4)


def test_it_knows_the_categories_of_the_paper() -> None:
    known = RotationNetwork().categories
    paper = {"bag", "bed", "bench", "bottle", "car", "chair", "clock", "motorbike", "oven", "table"}
    assert paper <= set(known)


def test_an_unknown_category_is_no_error() -> None:
    crop = np.full((1, _SIDE, _SIDE, 3), 200, np.uint8)
    answer = RotationNetwork(threads=1).look(crop, describe(lite0("cpu", 1), crop), "unicorn", (False,))
    assert np.isfinite(answer.shares[0]).all()


def test_a_missing_file_is_told(tmp_path: Path) -> None:
    with pytest.raises(DependencyError, match=r"no rotation network at .*net\.onnx"):
        _ = RotationNetwork(tmp_path / "net.onnx").categories
