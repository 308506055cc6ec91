"""Putting things into a picture, against plain formulas."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.training.synth.compose import cover, paste, relight, shade_ground
from cadpose.training.synth.views import camera_on, random_lights, random_rotation


def picture(seed: int, *shape: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, shape, np.uint8)


def test_pasting_mixes_by_alpha() -> None:
    canvas, rgb, alpha = picture(0, 20, 30, 3), picture(1, 20, 30, 3), picture(2, 20, 30)
    alpha[:5], alpha[5:10] = 0, 255
    share = alpha[..., None] / 255.0
    expected = rgb * share + canvas * (1.0 - share)
    before = canvas.copy()
    paste(canvas, rgb, alpha)
    assert np.array_equal(canvas[:5], before[:5])
    assert np.array_equal(canvas[5:10], rgb[5:10])
    assert np.abs(canvas - expected).max() <= 2


def test_light_darkens() -> None:
    canvas = np.full((4, 4, 3), 200, np.uint8)
    light = np.ones((4, 4, 3), np.float32)
    light[0], light[1] = 0.5, 0.0
    relight(canvas, light)
    assert canvas[0, 0].tolist() == [146] * 3  # 200 · 0.5 ** (1 / 2.2)
    assert not canvas[1].any() and (canvas[2:] == 200).all()


@pytest.mark.parametrize("seed", range(8))
def test_a_shadow_only_darkens(seed: int) -> None:
    rng = np.random.default_rng(seed)
    vertices = rng.uniform(-0.28, 0.28, (50, 3)).astype(np.float32)
    camera, _ = camera_on(
        random_rotation(rng),
        np.ascontiguousarray(vertices.T),
        longer_px=60.0,
        centre_px=(50.0, 50.0),
        t_z=2.0,
        size=100,
    )
    canvas = np.full((100, 100, 3), 180, np.uint8)
    shade_ground(canvas, vertices, camera, random_lights(rng), rng)
    assert canvas.max() <= 180 and canvas.min() > 20


def test_covers_hide_a_part_of_the_box() -> None:
    shares = []
    for seed in range(60):
        alpha = cover(96, np.array([20.0, 24.0, 70.0, 80.0]), np.random.default_rng(seed))
        assert alpha.shape == (96, 96) and alpha.dtype == np.uint8
        shares.append(float((alpha[24:80, 20:70] >= 128).mean()))
    assert max(shares) < 0.75
    assert sum(share > 0.02 for share in shares) > 45
