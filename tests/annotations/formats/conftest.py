from __future__ import annotations

import pytest

from cadpose.library.catalogue import Library
from tests.annotations.formats.made import Made, make


@pytest.fixture(scope="session")
def made(tmp_path_factory: pytest.TempPathFactory, small_library: Library) -> Made:
    """Not to be changed."""
    return make(tmp_path_factory.mktemp("photos"), small_library)
