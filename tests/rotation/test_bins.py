"""Angles to bins and back, as the method says."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from cadpose.geometry.angles import flip_angles, geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.rotation.bins import (
    BIN_DEGREES,
    BINS,
    BinnedAngles,
    angles_from_labels,
    decode,
    decode_hypotheses,
    encode_angles,
    encode_labels,
    flip_labels,
    labels_from_angles,
    probabilities,
    turn_labels,
)

azimuths = st.floats(-720, 720)
elevations = st.floats(-90, 89.5)
inplanes = st.floats(-180, 180)
whole = st.tuples(st.integers(0, 359), st.integers(-90, 89), st.integers(-179, 180))


def as_outputs(coded: BinnedAngles) -> tuple[list[FloatArray], list[FloatArray]]:
    """Logits and offsets of a network that is sure of the bins; its other offsets are nonsense."""
    logits, offsets = [], []
    for i, bins in enumerate(BINS):
        rows = np.arange(len(coded.bins))
        logit, offset = np.full((len(rows), bins), -5.0), np.full((len(rows), bins), 77.0)
        logit[rows, coded.bins[:, i]] = 5.0
        offset[rows, coded.bins[:, i]] = coded.offsets[:, i]
        logits.append(logit)
        offsets.append(offset)
    return logits, offsets


def test_labels_are_those_of_the_method() -> None:
    labels = labels_from_angles([0, 90, 359.5, 45.7], [0, -90, 20.9, 89.9], [0, 15, -180, 180])
    assert labels.tolist() == [[0, 90, 180], [270, 0, 195], [0, 110, 0], [314, 179, 0]]
    coded = encode_labels(labels)
    assert coded.bins.tolist() == [[0, 6, 12], [18, 0, 13], [0, 7, 0], [20, 11, 0]]
    np.testing.assert_allclose(coded.offsets[3], [14 / 15, 14 / 15, 0])


def test_from_straight_above_takes_the_last_bin() -> None:
    assert labels_from_angles(0, 90).tolist() == [[0, 179, 180]]


@given(azimuths, elevations, inplanes)
def test_there_and_back_within_a_degree_an_angle(azimuth: float, elevation: float, inplane: float) -> None:
    back = decode(*as_outputs(encode_angles(azimuth, elevation, inplane)))[0]
    labels = np.array([(360 - azimuth) % 360, elevation + 90, (inplane + 180) % 360])
    again = np.array([(360 - back[0]) % 360, back[1] + 90, (back[2] + 180) % 360])
    off = np.abs(labels - again)
    off = np.minimum(off, 360 - off)
    assert (off < 1.0 + 1e-5).all()
    # Three truncated angles, each a turn of less than a degree.
    R = rotation_from_angles(azimuth, elevation, inplane)
    assert float(geodesic_degrees(R, rotation_from_angles(*back))) < 3.0


@given(whole)
def test_whole_degrees_come_back_exactly(angles: tuple[int, int, int]) -> None:
    back = decode(*as_outputs(encode_angles(*angles)))[0]
    np.testing.assert_allclose(back, angles, atol=1e-9)
    np.testing.assert_allclose(angles_from_labels(labels_from_angles(*angles))[0], angles, atol=1e-9)


@given(whole)
def test_a_flipped_photo_has_flipped_angles(angles: tuple[int, int, int]) -> None:
    flipped = flip_labels(labels_from_angles(*angles))
    assert flipped.tolist() == labels_from_angles(*flip_angles(*angles)).tolist()
    assert flip_labels(flipped).tolist() == labels_from_angles(*angles).tolist()


@given(whole, st.integers(-180, 180))
def test_a_turned_photo_has_a_turned_inplane_rotation(angles: tuple[int, int, int], turn: int) -> None:
    turned = turn_labels(labels_from_angles(*angles), turn)
    assert turned.tolist() == labels_from_angles(angles[0], angles[1], angles[2] + turn).tolist()


def test_many_at_once_equal_one_by_one() -> None:
    rng = np.random.default_rng(3)
    angles = [rng.uniform(0, 360, 40), rng.uniform(-90, 90, 40), rng.uniform(-180, 180, 40)]
    together = encode_angles(*angles)
    for i in range(40):
        single = encode_angles(*(a[i] for a in angles))
        assert (single.bins[0] == together.bins[i]).all() and (single.offsets[0] == together.offsets[i]).all()


@given(st.data())
def test_hypotheses_are_the_likeliest_products(data: Any) -> None:
    logits = [data.draw(arrays(np.float64, (2, k), elements=st.integers(-3, 3).map(float))) for k in BINS]
    offsets = [data.draw(arrays(np.float64, (2, k), elements=st.floats(0, 0.9))) for k in BINS]
    count = data.draw(st.integers(1, 40))
    angles, shares = decode_hypotheses(logits, offsets, count)
    joint = np.einsum("na,ne,ni->naei", *(probabilities(a) for a in logits)).reshape(2, -1)
    np.testing.assert_allclose(shares, -np.sort(-joint, axis=1)[:, :count])
    np.testing.assert_allclose(angles[:, 0], decode(logits, offsets))
    assert angles.shape == (2, count, 3)


def test_all_hypotheses_sum_to_one_and_differ() -> None:
    rng = np.random.default_rng(1)
    logits = [rng.normal(size=(1, k)) for k in BINS]
    offsets = [np.full((1, k), 0.5) for k in BINS]
    angles, shares = decode_hypotheses(logits, offsets, int(np.prod(BINS)))
    assert shares.sum() == pytest.approx(1.0)
    assert len(np.unique(angles[0].round(3), axis=0)) == np.prod(BINS)


def test_offsets_beyond_the_range_are_clamped() -> None:
    logits, offsets = as_outputs(encode_labels(np.array([[359, 179, 359]])))
    for offset in offsets:
        offset[offset < 1] = 3.0
    assert decode(logits, offsets)[0].tolist() == [0.0, 90.0, 180.0]
    for offset in offsets:
        offset[:] = -40.0
    assert decode(logits, offsets)[0].tolist() == [0.0, -90.0, 180.0]


def test_what_is_refused() -> None:
    with pytest.raises(ValueError, match="elevation"):
        labels_from_angles(0, 91)
    with pytest.raises(ValueError, match="finite"):
        labels_from_angles(float("nan"), 0)
    good = [np.zeros((1, k)) for k in BINS]
    with pytest.raises(ValueError, match="expected three"):
        decode(good, good[:2])
    with pytest.raises(ValueError, match="count"):
        decode_hypotheses(good, good, 0)
    with pytest.raises(ValueError, match="column"):
        BinnedAngles(np.array([[0, 12, 0]]), np.zeros((1, 3)))
    with pytest.raises(ValueError, match=r"\[0, 1\)"):
        BinnedAngles(np.zeros((1, 3), np.int64), np.ones((1, 3)))
    assert BIN_DEGREES * np.array(BINS) == pytest.approx([360, 180, 360])
