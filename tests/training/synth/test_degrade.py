from __future__ import annotations

import numpy as np

from cadpose.training.synth.degrade import degraded


def ramp() -> np.ndarray:
    across = np.linspace(40, 210, 96).astype(np.uint8)
    return np.repeat(np.repeat(across[None, :, None], 96, axis=0), 3, axis=2).copy()


def test_no_chance_no_change() -> None:
    picture = ramp()
    assert np.array_equal(degraded(picture, np.random.default_rng(0), 0.0), picture)


def test_flaws_change_the_picture_and_not_where_things_are() -> None:
    picture, changed = ramp(), 0
    for seed in range(40):
        out = degraded(picture, np.random.default_rng(seed), 1.0)
        assert out.shape == picture.shape and out.dtype == np.uint8
        assert np.array_equal(out, degraded(picture, np.random.default_rng(seed), 1.0))
        changed += not np.array_equal(out, picture)
        # The ramp's middle stays in the middle, to half a pixel: halves compare as before.
        left, right = out[:, :48].astype(float), out[:, 48:].astype(float)
        assert right.mean() - left.mean() > 40
        assert np.corrcoef(out.mean(axis=(0, 2)), picture.mean(axis=(0, 2)))[0, 1] > 0.97
    assert changed == 40
    assert np.array_equal(picture, ramp())
