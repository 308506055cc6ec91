from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from PIL import Image

from cadpose.geometry.boxes import Box
from cadpose.records import Rotation
from cadpose.rotation.bins import labels_from_angles
from cadpose.training.posecontrast import augment
from cadpose.training.posecontrast.augment import (
    jittered_box,
    letterboxed,
    lighting_noise,
    plain_view,
    recoloured,
    training_views,
)


@pytest.fixture
def rgb() -> NDArray[np.uint8]:
    """Red left, blue right, green above."""
    image = np.zeros((300, 400, 3), np.uint8)
    image[:, :200, 0] = image[:, 200:, 2] = 200
    image[:150, :, 1] = 120
    return image


@pytest.fixture
def unchanged_colours(monkeypatch: pytest.MonkeyPatch) -> None:
    for chance in ("COLOUR_CHANCE", "GREY_CHANCE", "BLUR_CHANCE"):
        monkeypatch.setattr(augment, chance, 0.0)


@pytest.mark.usefixtures("unchanged_colours")
def test_labels_follow_the_pictures(rgb: NDArray[np.uint8], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(augment, "BOX_JITTER", 0.0)
    turns = set()
    for seed in range(12):
        views = training_views(
            rgb, Box(100, 50, 300, 250), Rotation(40, 10, 170), np.random.default_rng(seed)
        )
        query, turned, mirrored, _ = views.images
        assert views.labels[0].tolist() == [320, 100, 350]
        np.testing.assert_array_equal(mirrored, query[:, ::-1])
        assert views.labels[2].tolist() == [40, 100, 10]
        turn = int(views.labels[1][2] - views.labels[0][2] + 180) % 360 - 180
        turns.add(turn)
        # Counter-clockwise brings the blue right half up: the top middle shows less red or more.
        red = (turned[:56, 112:140, 0] > 100).mean() - (turned[:56, 84:112, 2] > 100).mean()
        assert np.sign(red) == -np.sign(turn)
        assert views.labels[1][:2].tolist() == [320, 100]
    assert turns == {-15, 15}


def test_nothing_but_the_generator_decides(rgb: NDArray[np.uint8]) -> None:
    def views(seed: int) -> list[NDArray[np.generic]]:
        drawn = training_views(rgb, Box(50, 20, 390, 290), Rotation(0, 0), np.random.default_rng(seed))
        return [drawn.images, drawn.lighting, drawn.labels]

    assert all(np.array_equal(a, b) for a, b in zip(views(1), views(1), strict=True))
    assert not np.array_equal(views(1)[0], views(2)[0])


@pytest.mark.usefixtures("unchanged_colours")
def test_the_positive_is_jittered_on_its_own(rgb: NDArray[np.uint8]) -> None:
    images = training_views(rgb, Box(50, 20, 390, 290), Rotation(0, 0), np.random.default_rng(0)).images
    assert not np.array_equal(images[0], images[3])


@given(st.integers(0, 2**32), st.floats(1, 500), st.floats(1, 500))
def test_edges_move_by_a_tenth_at_most(seed: int, width: float, height: float) -> None:
    box = Box.from_xywh(10, 20, width, height)
    moved = jittered_box(box, np.random.default_rng(seed))
    shares = np.subtract(moved.to_tuple(), box.to_tuple()) / (width, height, width, height)
    assert np.abs(shares).max() <= 0.1 + 1e-9


@given(st.integers(1, 400), st.integers(1, 400))
def test_letterboxing_keeps_the_aspect_and_is_black_beside(width: int, height: int) -> None:
    square = np.asarray(letterboxed(Image.new("RGB", (width, height), (255, 255, 255))), np.uint8)
    assert square.shape == (224, 224, 3)
    seen = square.max(axis=2) > 0
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    assert max(len(rows), len(columns)) == 224
    assert abs(len(columns) - max(1, 224 * width / max(width, height))) <= 0.5
    assert abs(len(rows) - max(1, 224 * height / max(width, height))) <= 0.5
    for at in (rows, columns):  # in the middle
        assert abs(at[0] - (223 - at[-1])) <= 1


def test_boxes_beyond_the_photo(rgb: NDArray[np.uint8]) -> None:
    seen = plain_view(rgb, Box(-50, -50, 450, 350)).max(axis=2) > 0
    assert seen.sum() == 224 * 168
    one = training_views(rgb, Box(399.6, 299.6, 399.9, 299.9), Rotation(0, 0), np.random.default_rng(0))
    assert one.images.shape == (4, 224, 224, 3)


def test_colours_change_as_often_as_told(rgb: NDArray[np.uint8]) -> None:
    rgb = np.ascontiguousarray(rgb[::20, ::20])
    image = Image.fromarray(rgb)
    rng = np.random.default_rng(0)
    drawn = [np.asarray(recoloured(image, rng)).astype(int) for _ in range(300)]
    grey = np.mean([np.ptp(d, axis=2).max() == 0 for d in drawn])
    same = np.mean([np.array_equal(d, rgb) for d in drawn])
    assert grey == pytest.approx(0.2, abs=0.07) and same == pytest.approx(0.2 * 0.8, abs=0.07)
    # Brightness within half and three halves, contrast and saturation pull further.
    assert 10 < min(d.mean() for d in drawn) < 60 < max(d.mean() for d in drawn) < 180


def test_blur_is_for_large_objects_and_not_for_the_positive(
    rgb: NDArray[np.uint8], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in (
        ("COLOUR_CHANCE", 0.0),
        ("GREY_CHANCE", 0.0),
        ("BLUR_CHANCE", 1.0),
        ("BOX_JITTER", 0.0),
    ):
        monkeypatch.setattr(augment, name, value)
    noisy = np.random.default_rng(0).integers(0, 256, (300, 400, 3), np.uint8)
    large = training_views(noisy, Box(50, 20, 300, 270), Rotation(0, 0), np.random.default_rng(1)).images
    assert large[0].std() < 0.7 * large[3].std()
    small = training_views(noisy, Box(50, 20, 250, 220), Rotation(0, 0), np.random.default_rng(1)).images
    np.testing.assert_array_equal(small[0], small[3])


def test_lighting_noise_lies_along_the_principal_colours() -> None:
    rng = np.random.default_rng(0)
    noise = np.stack([lighting_noise(rng) for _ in range(4000)])
    along = noise @ augment.PCA_VECTORS
    np.testing.assert_allclose(along.std(axis=0), 0.1 * augment.PCA_VALUES, rtol=0.1)


def test_straight_from_above_is_the_last_bin() -> None:
    assert labels_from_angles(0, 90)[0, 1] == 179
