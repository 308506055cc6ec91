"""Fixtures and settings that every test may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

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
