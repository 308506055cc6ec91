from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import crop_square
from cadpose.records import Views
from cadpose.similarity.embedding import DIMENSIONS, SIDE, ViewEmbedder, embedding_network
from cadpose.weights import REGISTRY

pytest.importorskip("onnx", reason="needs cadpose[train]")
from tests.similarity.index.made import network


@pytest.fixture(scope="module")
def embedder() -> ViewEmbedder:
    return ViewEmbedder(network(), threads=1)


def noise(n: int, side: int = SIDE) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return np.random.default_rng(n).integers(0, 255, (n, side, side, 3), dtype=np.uint8)


def test_embeddings_are_of_unit_length_and_one_an_image(embedder: ViewEmbedder) -> None:
    images = noise(5)
    embeddings = embedder.embed(images)
    assert embeddings.shape == (5, DIMENSIONS) and embeddings.dtype == np.float32
    np.testing.assert_allclose(np.linalg.norm(embeddings, axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(embedder.embed(images[3:4])[0], embeddings[3])
    assert embedder.embed(images[:0]).shape == (0, DIMENSIONS)


def test_a_crop_and_a_view_are_framed_on_white(embedder: ViewEmbedder) -> None:
    photo, box = noise(1, 200)[0], Box(20.0, 30.0, 180.0, 90.0)
    np.testing.assert_array_equal(
        embedder.crop(photo, box), embedder.embed(crop_square(photo, box, SIDE)[None])[0]
    )
    empty = Views(
        np.zeros((1, SIDE, SIDE, 3), np.uint8),
        np.zeros((1, SIDE, SIDE), np.uint8),
        np.full((1, SIDE, SIDE), np.inf, np.float32),
    )
    white = np.full((1, SIDE, SIDE, 3), 255, np.uint8)
    np.testing.assert_array_equal(embedder.views(empty), embedder.embed(white))


def test_images_of_another_shape_are_refused(embedder: ViewEmbedder) -> None:
    with pytest.raises(ValueError, match="uint8"):
        embedder.embed(noise(1, 96))


@pytest.mark.parametrize("data", [network(length=64), network(normalised=False), b"no network"])
def test_other_networks_are_refused_in_a_sentence(data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.onnx"
    path.write_bytes(data)
    with pytest.raises(InputError, match="name another file") as told:
        ViewEmbedder(path)
    assert str(path) in str(told.value) and "\n" not in str(told.value)


def test_the_digest_tells_networks_apart(embedder: ViewEmbedder) -> None:
    assert ViewEmbedder(network()).sha256 == embedder.sha256 != ViewEmbedder(network(1)).sha256


def test_which_network_is_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CADPOSE_EMBEDDING", raising=False)
    monkeypatch.delitem(REGISTRY, "embedding", raising=False)
    with pytest.raises(DependencyError, match="--embedding"):
        embedding_network()
    monkeypatch.setenv("CADPOSE_EMBEDDING", str(tmp_path / "a.onnx"))
    assert embedding_network() == tmp_path / "a.onnx"
    assert embedding_network(tmp_path / "b.onnx") == tmp_path / "b.onnx"
    with pytest.raises(InputError, match="cannot be read"):
        ViewEmbedder(tmp_path / "a.onnx")
