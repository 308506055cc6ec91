"""Blur, grain and tone of a photo."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.replacement.look import look_of

ALL = np.ones((200, 200), np.bool_)


def squares(blur: float = 0.0, noise: float = 0.0) -> NDArray[np.uint8]:
    """Grey squares of many levels, drawn four times as large so that edges are anti-aliased."""
    rng = np.random.default_rng(2)
    big = np.full((800, 800), 60.0)
    for _ in range(60):
        x, y = rng.integers(0, 700, 2)
        big[y : y + 90, x : x + 90] = rng.integers(40, 220)
    grey = cv2.resize(big, (200, 200), interpolation=cv2.INTER_AREA)
    if blur:
        grey = cv2.GaussianBlur(grey, (0, 0), blur)
    grey = grey + rng.normal(0, noise, grey.shape)
    return np.asarray(np.clip(grey, 0, 255)[..., None].repeat(3, axis=2), np.uint8)


def test_blur_is_measured() -> None:
    assert look_of(squares(), ALL).blur < 0.4
    assert look_of(squares(blur=1.5), ALL).blur == pytest.approx(1.5, abs=0.5)


def test_grain_is_measured() -> None:
    assert look_of(squares(), ALL).noise < 0.5
    assert look_of(squares(noise=4.0), ALL).noise == pytest.approx(4.0, abs=1.3)


def test_grain_is_as_strong_as_told_and_repeats_itself() -> None:
    look = look_of(squares(noise=4.0), ALL)
    grain = look.grain((100, 100), seed=1)
    assert grain.std() == pytest.approx(look.noise, rel=0.05)
    assert (grain == look.grain((100, 100), seed=1)).all()


def test_a_sepia_photo_tones_what_is_put_into_it() -> None:
    sepia = np.clip(squares() * np.array([1.0, 0.9, 0.7]), 0, 255).astype(np.uint8)
    look = look_of(sepia, ALL)
    assert look.tone is not None
    red, green, blue = look.toned(np.array([[20.0, 60.0, 240.0]]))[0]
    assert red > green > blue


def test_a_colour_photo_does_not() -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (200, 200, 3)).astype(np.uint8)
    look = look_of(rgb, ALL)
    assert look.tone is None
    assert look.toned(np.array([1.0, 2.0, 3.0])).tolist() == [1.0, 2.0, 3.0]
