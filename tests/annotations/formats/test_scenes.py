"""Scenes by the export verb: one safely named file a photo, in either placement."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import pytest

from cadpose.annotations.formats.registry import documents_from, export
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.scenes.glb import read_header
from cadpose.errors import InputError
from tests.annotations.formats.made import Made


@pytest.mark.parametrize(("name", "ending"), [("gltf", ".glb"), ("usd", ".usdz")])
def test_a_file_a_photo_and_none_elsewhere(made: Made, tmp_path: Path, name: str, ending: str) -> None:
    out = made.export(name, tmp_path / "deep" / "out")
    files = sorted(path.name for path in out.iterdir())
    assert len(files) == len(made.documents)
    assert all(file.endswith(ending) and " " not in file and ";" not in file for file in files)
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [
        path for path in out.iterdir() if path.is_file()
    ]
    one = next(out.glob("e_vil*"))
    assert list(documents_from(name, one)) == [made.documents[2]]


def test_the_photos_own_camera_keeps_shapes(made: Made, tmp_path: Path) -> None:
    for photo_camera in (False, True):
        out = tmp_path / str(photo_camera)
        export("gltf", made.documents[:1], out, replace(made.sources, photo_camera=photo_camera))
        data = next(out.iterdir()).read_bytes()
        header = read_header(io.BytesIO(data), len(data))
        stretch = [node["extras"]["cadpose"]["stretch"] for node in header["nodes"] if "scale" in node]
        assert len(stretch) == 2
        assert all((max(s) - min(s) < 1e-9) == photo_camera for s in stretch)


def test_without_the_photos_nothing_is_left(made: Made, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--photos"):
        export("gltf", made.documents, tmp_path / "out", Sources(made.library.path))
    assert list(tmp_path.iterdir()) == []
