"""Angles as bins of 15° with offsets, as PoseContrast codes them, and back.

The labels are whole degrees that are never negative: l0 = (360 - azimuth) mod 360, l1 = elevation + 90,
l2 = (in-plane + 180) mod 360, truncated. A label l lies in bin l // 15 at offset (l mod 15) / 15; back
it goes as (bin + offset) · 15. Azimuth and in-plane rotation have 24 bins, elevation has 12.

Source: Xiao, Du, Marlet, "PoseContrast: Class-Agnostic Object Viewpoint Estimation in the Wild with
Pose-Aware Contrastive Learning", 3DV 2021, and the authors' published code.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cadpose.geometry.angles import wrap180, wrap360
from cadpose.geometry.frames import FloatArray

#: Width of a bin in degrees.
BIN_DEGREES = 15
#: Bins of azimuth, elevation and in-plane rotation.
BINS = (24, 12, 24)
#: Range of each label in degrees.
RANGES = (360, 180, 360)
#: A whole degree that arithmetic with floats left a hair below is not truncated to the one before.
_HAIR = 1e-6


@dataclass(frozen=True, eq=False)
class BinnedAngles:
    """Bins and offsets of N rotations.

    Attributes:
        bins: (N, 3) int64: azimuth, elevation and in-plane bin.
        offsets: (N, 3) float64 in [0, 1): where in its bin each angle lies.

    Raises:
        ValueError: the shapes or values are not such.
    """

    bins: NDArray[np.int64]
    offsets: FloatArray

    def __post_init__(self) -> None:
        if self.bins.ndim != 2 or self.bins.shape[1] != 3 or self.bins.shape != self.offsets.shape:
            raise ValueError(f"bins {self.bins.shape} and offsets {self.offsets.shape} must both be (N, 3)")
        if (self.bins < 0).any() or (self.bins >= BINS).any():
            raise ValueError(f"bins must lie in [0, {BINS}) by column")
        if not ((self.offsets >= 0) & (self.offsets < 1)).all():
            raise ValueError("offsets must lie in [0, 1)")


def labels_from_angles(
    azimuth: ArrayLike, elevation: ArrayLike, inplane: ArrayLike = 0.0
) -> NDArray[np.int64]:
    """Angles in degrees to whole-degree labels.

    Args:
        azimuth: (N,) or scalar, any range; the three inputs broadcast.
        elevation: (N,) or scalar in [-90, 90].
        inplane: (N,) or scalar, any range.

    Returns:
        (N, 3) int64 in [0, 360) x [0, 180) x [0, 360). An elevation of 90, for which there is no bin,
        becomes 179; the method's authors leave such photos out.

    Raises:
        ValueError: an angle is not finite or an elevation is out of range.
    """
    az, el, ip = np.broadcast_arrays(
        *(np.atleast_1d(np.asarray(a, np.float64)) for a in (azimuth, elevation, inplane))
    )
    angles = np.stack([az, el, ip], axis=-1)
    if not np.isfinite(angles).all() or (np.abs(el) > 90.0).any():
        raise ValueError("angles must be finite and elevations within [-90, 90] degrees")
    degrees = np.stack([wrap360(-az), el + 90.0, wrap360(ip + 180.0)], axis=-1)
    labels = np.floor(degrees + _HAIR).astype(np.int64)
    labels[:, 1] = np.minimum(labels[:, 1], RANGES[1] - 1)
    return np.asarray(labels % RANGES)


def encode_labels(labels: NDArray[np.int64]) -> BinnedAngles:
    """(N, 3) whole-degree labels to bins and offsets."""
    return BinnedAngles(labels // BIN_DEGREES, (labels % BIN_DEGREES) / BIN_DEGREES)


def encode_angles(azimuth: ArrayLike, elevation: ArrayLike, inplane: ArrayLike = 0.0) -> BinnedAngles:
    """Angles in degrees to bins and offsets, see :func:`labels_from_angles`."""
    return encode_labels(labels_from_angles(azimuth, elevation, inplane))


def angles_from_labels(labels: ArrayLike) -> FloatArray:
    """Labels in degrees, whole or not, to angles.

    Args:
        labels: (..., 3) in degrees: 360 - azimuth, elevation + 90, in-plane + 180. As in the authors'
            code, what lies outside [0, 360] is clamped, and then the elevation to [0, 180].

    Returns:
        (..., 3) azimuth in [0, 360), elevation in [-90, 90], in-plane in (-180, 180].
    """
    clamped = np.clip(np.asarray(labels, np.float64), 0.0, 360.0)
    return np.stack(
        [
            wrap360(-clamped[..., 0]),
            np.minimum(clamped[..., 1], 180.0) - 90.0,
            wrap180(clamped[..., 2] - 180.0),
        ],
        axis=-1,
    )


def flip_labels(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """(N, 3) labels of the photo mirrored left-right: azimuth and in-plane rotation change sign."""
    return np.stack([-labels[:, 0] % 360, labels[:, 1], -labels[:, 2] % 360], axis=-1)


def turn_labels(labels: NDArray[np.int64], degrees: ArrayLike) -> NDArray[np.int64]:
    """(N, 3) labels of the photo turned counter-clockwise by whole degrees, (N,) or scalar."""
    turned = (labels[:, 2] + np.asarray(degrees, np.int64)) % 360
    return np.stack([labels[:, 0], labels[:, 1], turned], axis=-1)


def probabilities(logits: FloatArray) -> FloatArray:
    """(..., K) logits to a softmax over the last axis."""
    shifted = np.exp(np.asarray(logits, np.float64) - np.max(logits, axis=-1, keepdims=True))
    return np.asarray(shifted / shifted.sum(axis=-1, keepdims=True))


def decode(logits: Sequence[FloatArray], offsets: Sequence[FloatArray]) -> FloatArray:
    """Most likely bin of each angle with its offset: label = (argmax + offset[argmax]) · 15.

    Args:
        logits: Three arrays (N, 24), (N, 12), (N, 24).
        offsets: Three arrays of the same shapes.

    Returns:
        (N, 3) azimuth, elevation and in-plane rotation in degrees.

    Raises:
        ValueError: the shapes are not such.
    """
    _check(logits, offsets)
    labels = [_label_of(a.argmax(axis=1)[:, None], o)[:, 0] for a, o in zip(logits, offsets, strict=True)]
    return angles_from_labels(np.stack(labels, axis=-1))


def decode_hypotheses(
    logits: Sequence[FloatArray], offsets: Sequence[FloatArray], count: int
) -> tuple[FloatArray, FloatArray]:
    """The ``count`` likeliest triples of bins, their probability the product of the three softmaxes.

    The first triple is what :func:`decode` answers. The triples are exact: a triple among the first
    ``count`` uses bins among the first ``count`` of each angle.

    Args:
        logits: Three arrays (N, 24), (N, 12), (N, 24).
        offsets: Three arrays of the same shapes.
        count: How many, at least 1 and at most 24 · 12 · 24.

    Returns:
        (N, count, 3) angles in degrees, likeliest first, and (N, count) probabilities.

    Raises:
        ValueError: the shapes or the count are not such.
    """
    _check(logits, offsets)
    if not 1 <= count <= int(np.prod(BINS)):
        raise ValueError(f"count {count} is outside [1, {int(np.prod(BINS))}]")
    n = len(logits[0])
    # Stable, so that equal logits come in the order that argmax takes them in.
    orders = [np.argsort(-a, axis=1, kind="stable")[:, :count] for a in logits]
    shares = [np.take_along_axis(probabilities(a), o, axis=1) for a, o in zip(logits, orders, strict=True)]
    joint = np.einsum("na,ne,ni->naei", *shares).reshape(n, -1)
    first = np.argsort(-joint, axis=1, kind="stable")[:, :count]
    places = np.unravel_index(first, tuple(o.shape[1] for o in orders))
    labels = np.stack(
        [
            _label_of(np.take_along_axis(order, place, axis=1), offset)
            for order, place, offset in zip(orders, places, offsets, strict=True)
        ],
        axis=-1,
    )
    return angles_from_labels(labels), np.take_along_axis(joint, first, axis=1)


def _label_of(chosen: NDArray[np.int64], offsets: FloatArray) -> FloatArray:
    """(N, K) chosen bins to labels in degrees."""
    return np.asarray((chosen + np.take_along_axis(offsets, chosen, axis=1)) * float(BIN_DEGREES))


def _check(logits: Sequence[FloatArray], offsets: Sequence[FloatArray]) -> None:
    shapes = [np.shape(a) for a in (*logits, *offsets)]
    n = shapes[0][0] if shapes and len(shapes[0]) == 2 else -1
    if shapes != [(n, k) for k in BINS] * 2:
        raise ValueError(f"expected three logits and three offsets of (N, {BINS}), found {shapes}")
