"""Fixtures and settings that every test may use."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from tests.postgres_server import NewDatabase, postgres_server
from tests.small_library import write_models

REPOSITORY = Path(__file__).resolve().parent.parent

# Other work shares the machine: a slow example is no finding.
settings.register_profile("cadpose", deadline=None, max_examples=60)
settings.load_profile("cadpose")


@pytest.fixture(scope="session")
def bench() -> Path:
    """The folder that holds bench/ and photos/: $CADPOSE_BENCH, or ../shared beside the repository."""
    root = Path(os.environ.get("CADPOSE_BENCH", REPOSITORY.parent / "shared"))
    if not (root / "bench").is_dir():
        pytest.skip(f"needs the benchmark photos: no folder {root / 'bench'} (set CADPOSE_BENCH)")
    return root


@pytest.fixture(scope="session", autouse=True)
def _own_folders(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """No test reads or writes the user's library and cache; the tests' workers share one cache."""
    base = tmp_path_factory.getbasetemp()
    shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CADPOSE_LIBRARY", str(base / "no-library"))
        patch.setenv("CADPOSE_CACHE", str(shared / "cache"))
        yield


@pytest.fixture(scope="session")
def model_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three cars and two chairs as files."""
    return write_models(tmp_path_factory.mktemp("models") / "made")


@pytest.fixture(scope="session")
def small_library(model_files: Path, tmp_path_factory: pytest.TempPathFactory) -> Library:
    """A library of them; not to be written to."""
    library = Library.create(tmp_path_factory.mktemp("library"))
    assert not add_path(library, model_files).failed
    return library


@pytest.fixture(scope="session")
def new_postgres() -> Iterator[NewDatabase]:
    """Gives the URL of an empty database of a real PostgreSQL server; skipped where none is installed."""
    with postgres_server() as new_database:
        yield new_database
