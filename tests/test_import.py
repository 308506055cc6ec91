"""``import cadpose`` is cheap: it brings in nothing that is not needed to look around."""

from __future__ import annotations

import subprocess
import sys

import pytest

HEAVY = (
    "numba",
    "cv2",
    "onnxruntime",
    "trimesh",
    "scipy",
    "sqlalchemy",
    "torch",
    "bpy",
    "pydantic",
    "typer",
    "rich",
    "PIL",
)


def loaded_after(statement: str) -> set[str]:
    """Top-level names in sys.modules of a fresh interpreter after ``statement``."""
    code = f"{statement}\nimport sys\nprint(*sorted({{name.partition('.')[0] for name in sys.modules}}))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(run.stdout.split())


def test_import_brings_in_nothing_heavy() -> None:
    loaded = loaded_after("import cadpose")
    assert "cadpose" in loaded
    assert sorted(loaded.intersection(HEAVY)) == []


def test_records_and_geometry_bring_in_numpy_only() -> None:
    modules = "cadpose.records, cadpose.errors, cadpose.geometry.labels"
    loaded = loaded_after(f"import {modules}")
    assert "numpy" in loaded
    assert sorted(loaded.intersection(HEAVY)) == []


@pytest.mark.parametrize("name", ["cv2", "scipy"])
def test_the_listing_sees_what_is_loaded(name: str) -> None:
    assert name in loaded_after(f"import cadpose, {name}")


def test_every_public_name_can_be_had() -> None:
    import cadpose

    for name in cadpose.__all__:
        assert getattr(cadpose, name) is not None
    assert set(cadpose.__all__) <= set(dir(cadpose))
    with pytest.raises(AttributeError, match="no_such_name"):
        cadpose.no_such_name  # noqa: B018
