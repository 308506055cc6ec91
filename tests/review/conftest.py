"""Servers that tests share or have for themselves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="needs cadpose[review]")

from cadpose.library.catalogue import Library
from tests.annotations.formats.made import Made, make
from tests.review.serving import Served, serve


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, small_library: Library) -> Made:
    return make(tmp_path_factory.mktemp("review-photos"), small_library)


@pytest.fixture
def served(tmp_path: Path, small_library: Library, made: Made) -> Iterator[Served]:
    """One of its own, to be written to."""
    found = serve(tmp_path, small_library, made)
    yield found
    found.close()


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory, small_library: Library, made: Made) -> Iterator[Served]:
    """One for tests that write nothing."""
    found = serve(tmp_path_factory.mktemp("shared"), small_library, made)
    yield found
    found.close()
