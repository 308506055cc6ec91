"""Libraries for the evaluation: made-up spheres, and the cars of the Sweet Home 3D package."""

from __future__ import annotations

from pathlib import Path

import pytest
import trimesh

from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from cadpose.library.sweethome3d import DEBIAN_FOLDER
from tests.library.builders import obj_box


@pytest.fixture(scope="session")
def spheres(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Egg-like chairs of 320 to 20,480 faces, and a box."""
    folder = tmp_path_factory.mktemp("spheres")
    (folder / "chair").mkdir()
    for subdivisions in (2, 3, 4, 5):
        mesh = trimesh.creation.icosphere(subdivisions)
        # Differently flat each, or they would count as near duplicates.
        mesh.apply_scale([1.0, 1.0 + subdivisions / 4, 1.0])
        mesh.export(folder / "chair" / f"ball{subdivisions}.ply")
    (folder / "table").mkdir()
    (folder / "table" / "box.obj").write_text(obj_box(2, 1, 1))
    library = Library.create(tmp_path_factory.mktemp("library"))
    report = add_path(library, folder)
    assert len(report.added) == 5
    assert not report.failed
    return Library.open(library.path)


@pytest.fixture(scope="session")
def cars(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The category car of the installed Sweet Home 3D models."""
    if not any(DEBIAN_FOLDER.glob("*.sh3f")):
        pytest.skip(f"needs Debian's sweethome3d-furniture: no .sh3f file in {DEBIAN_FOLDER}")
    path: Path = tmp_path_factory.mktemp("cars")
    library = Library.create(path)
    assert add_path(library, DEBIAN_FOLDER, categories=("car",), workers=1).added
    return Library.open(path)
