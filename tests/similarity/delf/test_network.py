"""Held against TensorFlow: the numbers are what scripts/delf_reference.py prints, with TF-slim's own code."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.similarity.delf.features import resized
from cadpose.similarity.delf.parameters import Parameters
from tests.similarity.delf.made import image

torch = pytest.importorskip("torch")


def normalised(height: int, width: int) -> NDArray[np.float32]:
    return np.asarray((image(height, width) - 128.0) / 128.0, np.float32)


def test_features_and_attention_are_tensorflows(made: Parameters) -> None:
    from cadpose.similarity.delf.network import Network

    features, attention = Network(made)(normalised(97, 130))
    assert features.shape == (4, 5, 1024) and attention.shape == (4, 5)
    assert features.dtype == attention.dtype == np.float32
    np.testing.assert_allclose(features[:, :, ::256], np.array(F_97_130), rtol=1e-4, atol=0.06)
    np.testing.assert_allclose(attention, np.array(A_97_130), rtol=1e-4, atol=0.06)
    features, attention = Network(made)(normalised(64, 33))
    np.testing.assert_allclose(features[:, :, ::256], np.array(F_64_33), rtol=1e-4, atol=0.06)
    np.testing.assert_allclose(attention, np.array(A_64_33), rtol=1e-4, atol=0.06)


@pytest.mark.parametrize(("height", "width"), [(1, 1), (31, 32), (33, 64), (65, 181)])
def test_a_map_has_a_cell_for_every_32_pixels_begun(made: Parameters, height: int, width: int) -> None:
    from cadpose.similarity.delf.network import Network

    features, attention = Network(made)(np.zeros((height, width, 3), np.float32))
    assert features.shape == (-(-height // 32), -(-width // 32), 1024)
    assert attention.shape == features.shape[:2]


def test_a_device_that_is_not_there_is_told_of(made: Parameters, monkeypatch: pytest.MonkeyPatch) -> None:
    from cadpose.similarity.delf.network import Network

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(DependencyError, match="DELF on cuda needs a GPU"):
        Network(made, "cuda")


def test_scores_are_softplus(made: Parameters) -> None:
    """Large ones are what they were, negative ones small but above zero."""
    from cadpose.similarity.delf.network import Network
    from cadpose.similarity.delf.parameters import ATTENTION, Convolution

    def attention_of(bias: float) -> float:
        flat = Convolution(np.zeros((1, 512, 1, 1), np.float32), np.array([bias], np.float32))
        changed = Parameters("x", dict(made.convolutions) | {ATTENTION[1]: flat}, made.mean, made.projection)
        return float(Network(changed)(np.zeros((32, 32, 3), np.float32))[1][0, 0])

    for bias in (-30.0, -5.0, 0.0, 3.0, 19.0, 21.0, 250.0):
        assert attention_of(bias) == pytest.approx(np.logaddexp(0.0, bias), rel=1e-5)


def test_resizing_is_tensorflows() -> None:
    levels = np.arange(75).reshape(5, 5, 3) ** 1.5
    tiny = np.asarray((levels - 128.0) / 128.0, np.float32)
    np.testing.assert_allclose(
        resized(tiny, 7)[:, :, 0] * 128 + 128, np.array(ENLARGED), rtol=1e-5, atol=0.006
    )
    np.testing.assert_allclose(resized(tiny, 3)[:, :, 0] * 128 + 128, np.array(SHRUNK), rtol=1e-5, atol=0.006)
    np.testing.assert_array_equal(resized(tiny, 5), tiny)


F_97_130 = [
    [
        [0.0, 0.0, 666.91, 1871.45],
        [240.92, 0.0, 35.22, 2579.84],
        [489.42, 0.0, 11.46, 2815.81],
        [729.56, 0.0, 118.7, 2516.28],
        [539.59, 700.16, 0.0, 1057.81],
    ],
    [
        [0.0, 0.0, 388.9, 2102.99],
        [560.2, 0.0, 0.0, 4199.82],
        [707.47, 0.0, 0.0, 4090.11],
        [854.94, 0.0, 0.0, 4192.93],
        [795.39, 1106.71, 0.0, 1555.24],
    ],
    [
        [0.0, 0.0, 0.0, 1146.29],
        [1241.38, 0.0, 0.0, 3351.7],
        [1411.98, 0.0, 0.0, 4077.93],
        [1943.94, 0.0, 0.0, 4345.15],
        [977.89, 715.38, 0.0, 1873.74],
    ],
    [
        [458.98, 0.0, 20.04, 580.96],
        [547.89, 283.17, 274.55, 1300.94],
        [1043.11, 28.59, 0.0, 1989.99],
        [439.48, 0.0, 441.06, 2665.68],
        [121.96, 0.0, 1150.21, 1748.48],
    ],
]
A_97_130 = [
    [588.8, 1769.54, 1415.29, 1733.22, 819.44],
    [1306.17, 341.41, 774.4, 934.97, 759.5],
    [288.1, 0.0, 0.0, 741.15, 1462.62],
    [692.65, 282.65, 0.0, 0.0, 97.89],
]
F_64_33 = [
    [[0.0, 0.0, 1117.03, 1492.14], [363.12, 660.43, 0.0, 921.05]],
    [[0.0, 0.0, 957.14, 1570.65], [574.75, 319.97, 626.8, 819.64]],
]
A_64_33 = [
    [62.48, 851.76],
    [0.0, 734.36],
]
ENLARGED = [
    [0.0, 3.71, 9.27, 16.45, 25.24, 35.33, 41.57],
    [41.5, 51.88, 63.28, 75.62, 89.02, 103.35, 112.09],
    [103.62, 118.81, 134.6, 150.99, 168.14, 186.0, 196.82],
    [183.97, 202.56, 221.64, 241.21, 261.41, 282.21, 294.78],
    [282.22, 303.58, 325.38, 347.59, 370.37, 393.68, 407.75],
    [394.95, 418.75, 442.93, 467.5, 492.57, 518.13, 533.54],
    [464.76, 489.96, 515.54, 541.47, 567.88, 594.75, 610.94],
]
SHRUNK = [
    [0.0, 11.53, 31.86],
    [128.91, 168.0, 210.45],
    [356.17, 410.49, 467.24],
]
