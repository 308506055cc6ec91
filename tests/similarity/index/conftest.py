"""The networks of these tests are made with onnx, and searching wants FAISS."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from cadpose.similarity.embedding import ViewEmbedder

if find_spec("onnx") is None or find_spec("faiss") is None:
    collect_ignore_glob = ["test_*.py"]


@pytest.fixture(scope="session")
def embedder() -> ViewEmbedder:
    from tests.similarity.index.made import network

    return ViewEmbedder(network(), threads=1)
