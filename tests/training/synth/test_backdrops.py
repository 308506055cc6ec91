from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.errors import InputError
from cadpose.training.synth.backdrops import Backdrops


def test_made_up_ones_vary_and_return() -> None:
    made = [Backdrops().draw(np.random.default_rng(seed), 64) for seed in range(20)]
    again = [Backdrops().draw(np.random.default_rng(seed), 64) for seed in range(20)]
    assert all(b.shape == (64, 64, 3) and b.dtype == np.uint8 for b in made)
    assert all(np.array_equal(a, b) for a, b in zip(made, again, strict=True))
    assert np.std([b.mean() for b in made]) > 15


def test_photos_are_cut_as_often_as_asked(tmp_path: Path) -> None:
    Image.new("RGB", (900, 300), (255, 0, 255)).save(tmp_path / "a.png")
    backdrops = Backdrops(tmp_path)
    assert max(backdrops.photos[0].shape) == 400
    rng = np.random.default_rng(0)
    cuts = sum(bool((backdrops.draw(rng, 32, 0.5) == (255, 0, 255)).all()) for _ in range(200))
    assert 70 < cuts < 130
    assert all((backdrops.draw(rng, 32, 1.0) == (255, 0, 255)).all() for _ in range(20))


def test_a_banner_is_cut_as_well(tmp_path: Path) -> None:
    Image.new("RGB", (4000, 30), (0, 255, 255)).save(tmp_path / "banner.png")
    backdrops = Backdrops(tmp_path)
    assert min(backdrops.photos[0].shape[:2]) < 8
    assert (backdrops.draw(np.random.default_rng(0), 32, 1.0) == (0, 255, 255)).all()


@pytest.mark.parametrize("seed", range(8))
def test_textures(seed: int) -> None:
    texture = Backdrops().texture(np.random.default_rng(seed), 48)
    assert texture.shape == (48, 48, 3) and texture.dtype == np.uint8 and texture.std() > 0.5


def test_what_cannot_be_read_is_left_out_and_told(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    (tmp_path / "bad.jpg").write_bytes(b"no picture")
    with caplog.at_level(logging.WARNING), pytest.raises(InputError, match="holds no photo to use"):
        Backdrops(tmp_path)
    assert "bad.jpg is left out" in caplog.text
    Image.new("RGB", (30, 20)).save(tmp_path / "good.png")
    assert len(Backdrops(tmp_path).photos) == 1
