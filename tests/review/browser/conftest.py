"""Chromium, libraries and stores for the tests of the page."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from cadpose.library.sweethome3d import DEBIAN_FOLDER
from tests.review.browser.browsing import Browser, browsing, reviewing
from tests.review.browser.making import make_store


@pytest.fixture
def browser() -> Iterator[Browser]:
    with browsing() as found:
        yield found


@pytest.fixture(scope="session")
def real_library(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """A few real cups and motorbikes: what scikit-image's photos show."""
    if not any(DEBIAN_FOLDER.glob("*.sh3f")):
        pytest.skip(f"needs Debian's sweethome3d-furniture: no .sh3f file in {DEBIAN_FOLDER}")
    library = Library.create(tmp_path_factory.mktemp("real-library"))
    assert add_path(library, DEBIAN_FOLDER, categories=("cup", "motorbike"), limit=3, workers=1).added
    return library


@pytest.fixture
def six(tmp_path: Path, small_library: Library) -> Iterator[str]:
    """The address of a page over six made-up photos with one car each."""
    store = make_store(tmp_path, small_library, photos=6, size=(320, 240))
    with reviewing(
        store, "--photos", tmp_path / "photos", "--library", small_library.path, "--author", "Ada"
    ) as address:
        yield address
