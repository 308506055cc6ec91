from __future__ import annotations

import sys
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.errors import DependencyError
from cadpose.similarity.delf import features as module
from cadpose.similarity.delf.features import Delf, reduced
from cadpose.similarity.delf.parameters import Parameters
from cadpose.similarity.local_features import LocalFeatures, unit
from tests.similarity.delf.made import image

pytest.importorskip("torch")

FloatArray = NDArray[np.float32]


class OneBright:
    """Stands for the network: every cell scores 1 but those whose pixel 32 · (row, column) is white."""

    def __init__(self) -> None:
        self.sides: list[int] = []

    def __call__(self, image: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.sides.append(len(image))
        corners = image[::32, ::32].mean(axis=2)
        score = np.where(corners > 0.9, 200.0 + len(image), 1.0).astype(np.float32)
        rng = np.random.default_rng(len(image))
        return rng.normal(size=(*score.shape, 1024)).astype(np.float32), score


def finder(
    made: Parameters, network: Callable[[FloatArray], tuple[FloatArray, FloatArray]], side: int = 512
) -> Delf:
    delf = Delf(made, side=side)
    delf.network = network
    return delf


def white_at(x: int, y: int, side: int = 512, reach: int = 5) -> NDArray[np.uint8]:
    picture = np.zeros((side, side, 3), np.uint8)
    picture[max(0, y - reach) : y + reach + 1, max(0, x - reach) : x + reach + 1] = 255
    return picture


def test_places_at_all_scales(made: Parameters) -> None:
    network = OneBright()
    delf: LocalFeatures = finder(made, network)
    (found,) = delf.describe(white_at(256, 128)[None])
    # .25, .3536, .5, .7071, 1, 1.4142 and 2 of 512.
    assert network.sides == [128, 181, 256, 362, 512, 724, 1024]
    # Pixel (256, 128) is a multiple of 32 at .25, .5, 1 and 2; we count from the pixel's corner, in 224 px.
    right = np.array([256.5, 128.5]) * 224 / 512
    exact = np.linalg.norm(found.xy - right, axis=1) < 1e-9
    assert exact.sum() == 4 and (np.linalg.norm(found.xy - right, axis=1) < 5 * 224 / 512 * 1.5).all()
    assert found.descriptors.shape == (len(found), 40)
    np.testing.assert_allclose(np.linalg.norm(found.descriptors, axis=1), 1.0, atol=1e-5)


def test_small_images_are_enlarged_and_places_brought_back(made: Parameters) -> None:
    network = OneBright()
    (found,) = finder(made, network).describe(white_at(112, 56, side=224, reach=6)[None])
    assert network.sides[4] == 512
    assert len(found) and (np.abs(found.xy - (112.5, 56.5)).max(axis=1) < 8).all()
    finder(made, network, side=640).describe(white_at(1, 1)[None])
    assert network.sides[-1] == 1280


def test_only_features_within_the_mask(made: Parameters) -> None:
    picture = np.maximum(white_at(64, 64), white_at(448, 320))
    mask = np.zeros((1, 512, 512), np.bool_)
    mask[:, 256:, 256:] = True
    delf = finder(made, OneBright())
    (all_of_them,), (inside,) = delf.describe(picture[None]), delf.describe(picture[None], mask)
    assert 0 < len(inside) < len(all_of_them)
    assert (inside.xy > 224 / 2).all()
    # Each keeps its own descriptor.
    same = (all_of_them.xy > 224 / 2).all(axis=1)
    np.testing.assert_array_equal(inside.xy, all_of_them.xy[same])
    np.testing.assert_allclose(inside.descriptors, all_of_them.descriptors[same], atol=1e-6)
    assert len(delf.describe(picture[None], np.zeros_like(mask))[0]) == 0


def test_the_best_thousand_of_enough_attention(made: Parameters, monkeypatch: pytest.MonkeyPatch) -> None:
    def ramp(image: FloatArray) -> tuple[FloatArray, FloatArray]:
        n = -(-len(image) // 32)
        score = np.linspace(90.0, 3000.0, n * n, dtype=np.float32).reshape(n, n)
        return np.repeat(score[..., None], 1024, axis=2) * np.linspace(-1, 1, 1024, dtype=np.float32), score

    monkeypatch.setattr(module, "SCALES", (2.0, 1.0))
    (found,) = finder(made, ramp).describe(np.zeros((1, 512, 512, 3), np.uint8))
    assert len(found) == 1000
    # The highest score of both scales lies in the last cell: at scale 2 first, whose scores come first.
    np.testing.assert_allclose(found.xy[0], (31 * 16 + 0.5) * 224 / 512)
    np.testing.assert_allclose(found.xy[1], (15 * 32 + 0.5) * 224 / 512)
    monkeypatch.setattr(module, "SCALES", (1.0,))
    delf = finder(made, ramp)
    # Two of 256 cells are below 100.
    assert len(delf.describe(np.zeros((1, 512, 512, 3), np.uint8))[0]) == 255 - int(10 / (2910 / 255))
    delf.least_score = 3000.0
    assert len(delf.describe(np.zeros((1, 512, 512, 3), np.uint8))[0]) == 1


def test_an_image_without_attention_has_no_features(made: Parameters) -> None:
    found = finder(made, OneBright()).describe(np.zeros((2, 64, 64, 3), np.uint8))
    assert [len(f) for f in found] == [0, 0]
    assert found[0].xy.shape == (0, 2) and found[0].descriptors.shape == (0, 40)


def test_descriptors_are_unit_pca_unit(made: Parameters) -> None:
    raw = np.random.default_rng(0).random((5, 1024)).astype(np.float32)
    one = raw / np.linalg.norm(raw, axis=1, keepdims=True)
    projected = (one - made.mean) @ made.projection.T
    np.testing.assert_allclose(reduced(raw * 7, made), unit(projected), atol=1e-5)


def test_the_network_sees_normalised_pixels(made: Parameters) -> None:
    seen: list[FloatArray] = []

    def keep(image: FloatArray) -> tuple[FloatArray, FloatArray]:
        seen.append(image)
        return OneBright()(image)

    finder(made, keep).describe(np.full((1, 512, 512, 3), 128, np.uint8))
    finder(made, keep).describe(np.full((1, 512, 512, 3), 0, np.uint8))
    assert (seen[0] == 0).all() and (seen[7] == -1).all() and seen[0].dtype == np.float32


def test_what_is_missing_is_told(made: Parameters, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(ValueError, match="side 256"):
        Delf(made, side=256)
    with pytest.raises(DependencyError, match="delf_gld_20190411"):
        Delf()
    import torch

    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    with pytest.raises(DependencyError, match="cuda"):
        Delf(made, device="cuda")
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(DependencyError, match=r"pip install 'cadpose\[delf\]'"):
        Delf()


@pytest.mark.slow
def test_all_of_it_is_what_tensorflow_finds(made: Parameters) -> None:
    """The numbers are in answers.npz of scripts/delf_reference.py."""
    (found,) = Delf(made, least_score=635.4870483398438).describe(image(512, 512)[None])
    assert len(found) == 1000
    yx = [(0, 271.4932), (0, 384), (0, 192), (0, 320), (0, 128), (0, 180.9955), (0, 271.5316), (0, 256)]
    np.testing.assert_allclose(found.xy[:8, ::-1] * 512 / 224 - 0.5, yx, atol=1e-3)
    first = [-0.1288567, -0.0413328, 0.0683065, 0.1373311, 0.0711103, -0.3140374]
    np.testing.assert_allclose(found.descriptors[0, :6], first, atol=1e-5)
