from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from tests.batch.fakes import fake_annotator, picture


@pytest.fixture
def annotator(small_library: Library) -> Annotator:
    return fake_annotator(small_library)


@pytest.fixture
def photos(tmp_path: Path) -> list[Path]:
    return [picture(tmp_path / "photos" / f"{name}.png", seed) for seed, name in enumerate("abc")]
