"""Cameras and lights that are drawn at random."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from cadpose.geometry.angles import rotation_from_angles
from cadpose.training.synth.views import camera_on, random_angles, random_distance, random_lights


@given(
    st.integers(0, 2**32 - 1),
    st.floats(0, 360),
    st.floats(-89, 89),
    st.floats(-180, 180),
    st.floats(20, 300),
    st.floats(0.8, 20),
)
def test_the_camera_frames_what_it_is_told(
    seed: int, azimuth: float, elevation: float, inplane: float, longer: float, t_z: float
) -> None:
    points = np.random.default_rng(seed).uniform(-0.28, 0.28, (30, 3)).astype(np.float32)
    R = rotation_from_angles(azimuth, elevation, inplane)
    camera, rect = camera_on(
        R, np.ascontiguousarray(points.T), longer_px=longer, centre_px=(90.0, 120.0), t_z=t_z, size=224
    )
    pixels = camera.project(points.astype(np.float64))[0]
    found = np.concatenate([pixels.min(axis=0), pixels.max(axis=0)])
    np.testing.assert_allclose(found, rect, atol=1e-3 * longer)
    np.testing.assert_allclose((found[:2] + found[2:]) / 2, (90, 120), atol=1e-3 * longer)
    assert abs(max(found[2] - found[0], found[3] - found[1]) - longer) < 1e-3 * longer


def test_what_is_random_stays_in_its_range() -> None:
    rng = np.random.default_rng(0)
    angles = np.array([random_angles(rng) for _ in range(2000)])
    assert angles[:, 0].min() >= 0 and angles[:, 0].max() <= 360
    assert angles[:, 1].min() >= -30 and angles[:, 1].max() <= 85
    # Every side is as likely as another.
    assert np.histogram(angles[:, 0], 4, (0, 360))[0].min() > 400
    distances = [random_distance(rng, (1.3, 5.0)) for _ in range(500)]
    assert min(distances) >= 1.3 and max(distances) <= 5.0
    for _ in range(200):
        lights = random_lights(rng)
        assert lights.key[1] < 0 and lights.ambient >= lights.sky
