"""`cadpose.show`: pictures and widgets, and what is said when something is not there."""

from __future__ import annotations

import io
import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

import cadpose
from cadpose import notebook
from cadpose.annotations.document import document_from
from cadpose.errors import DependencyError, InputError
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation, Photo
from cadpose.rle import decode_mask, runs_from_text
from tests.replacement.scenes import annotated, street
from tests.small_library import save


class Place:
    """A photo in a folder with the annotation of its car and the document."""

    def __init__(self, library: Library, folder: Path) -> None:
        shot = street(library).shot
        self.path = save(folder / "street.png", shot.photo.rgb)
        self.photo: Photo = read_photo(self.path)
        self.annotation: Annotation = annotated(self.photo, shot.cad, shot.mask, shot)
        self.document = folder / "street.json"
        self.document.write_text(document_from(self.photo, [self.annotation]).to_json())


@pytest.fixture(scope="module")
def place(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Place:
    return Place(small_library, tmp_path_factory.mktemp("notebook"))


def test_a_picture_where_there_is_no_notebook(place: Place, small_library: Library) -> None:
    shown = cadpose.show(place.annotation, library=small_library)
    with Image.open(io.BytesIO(shown._repr_png_())) as image:
        assert image.format == "PNG" and image.size == shown.image.size
    plain = np.asarray(Image.fromarray(place.photo.rgb).resize(shown.image.size))
    assert np.abs(plain.astype(int) - np.asarray(shown.image)).mean() > 2
    assert "save" in repr(shown)


@pytest.mark.parametrize("kind", ["list", "document", "file", "file as text"])
def test_what_may_be_shown(kind: str, place: Place, small_library: Library) -> None:
    told: Any = {
        "list": [place.annotation, place.annotation],
        "document": document_from(place.photo, [place.annotation]),
        "file": place.document,
        "file as text": str(place.document),
    }[kind]
    assert cadpose.show(told, library=small_library.path).image.width >= 960


def test_the_photo_may_lie_beside_the_document(
    place: Place, small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told = json.loads(place.document.read_text())
    told["photo"]["name"] = "elsewhere/street.png"
    (tmp_path / "moved.json").write_text(json.dumps(told))
    with pytest.raises(InputError, match=r"elsewhere/street\.png is not to be found.*photo="):
        cadpose.show(tmp_path / "moved.json", library=small_library)
    shutil.copy(place.path, tmp_path / "street.png")
    assert cadpose.show(tmp_path / "moved.json", library=small_library).image


@pytest.mark.parametrize("ending", [".png", ".jpg"])
def test_it_is_saved(ending: str, place: Place, small_library: Library, tmp_path: Path) -> None:
    shown = cadpose.show(place.annotation, place.photo.rgb, small_library)
    shown.save(tmp_path / f"shown{ending}")
    with Image.open(tmp_path / f"shown{ending}") as image:
        assert image.size == shown.image.size
    with pytest.raises(InputError, match=r"must end in \.png or \.jpg"):
        shown.save(tmp_path / "shown.bmp")


def test_another_photo_is_refused(place: Place, small_library: Library, tmp_path: Path) -> None:
    other = save(tmp_path / "other.png", place.photo.rgb[::-1])
    with pytest.raises(InputError, match=r"other\.png is not the photo"):
        cadpose.show(place.annotation, other, small_library)
    with pytest.raises(InputError, match="is not the photo"):
        cadpose.show(place.annotation, place.photo.rgb[:100], small_library)


def test_nothing_and_two_photos(place: Place, small_library: Library, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nothing to show"):
        cadpose.show([], library=small_library)
    other = replace(place.annotation, photo_sha256="0" * 64, photo_name="b.png")
    with pytest.raises(InputError, match="two photos"):
        cadpose.show([place.annotation, other], library=small_library)
    with pytest.raises(InputError, match="cannot be read"):
        cadpose.show(tmp_path / "missing.json", library=small_library)


def test_a_model_that_changed_is_told(place: Place, small_library: Library) -> None:
    first = place.annotation.candidates[0]
    changed = replace(place.annotation, candidates=(replace(first, cad=replace(first.cad, sha256="0" * 64)),))
    with pytest.raises(InputError, match=r"is not the one that was annotated.*library="):
        cadpose.show(changed, library=small_library)


def test_without_anywidget_it_is_told(
    place: Place, small_library: Library, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(notebook, "find_spec", lambda name: None)
    with pytest.raises(DependencyError, match=r"cadpose\[jupyter\]"):
        cadpose.show(place.annotation, library=small_library, interactive=True)
    # In a notebook it falls back to the picture.
    monkeypatch.setattr(notebook, "_in_notebook", lambda: True)
    assert isinstance(cadpose.show(place.annotation, library=small_library), notebook.Picture)


def test_without_its_script_it_is_told(
    place: Place, small_library: Library, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    pytest.importorskip("anywidget")
    monkeypatch.setattr(notebook, "_SCRIPT", tmp_path / "widget.js")
    with pytest.raises(DependencyError, match="make web"):
        cadpose.show(place.annotation, library=small_library, interactive=True)


def test_the_widgets_traits(place: Place, small_library: Library) -> None:
    pytest.importorskip("anywidget")
    widget = cadpose.show(place.annotation, library=small_library, interactive=True)
    state = widget.get_state()
    assert "azimuth" in state["pose"] and state["display"] == "blend"
    assert "render" in state["_esm"] or "render" in str(widget._esm)
    with Image.open(io.BytesIO(widget.photo_png)) as image:
        assert (np.asarray(image) == place.photo.rgb).all()
    assert widget.photo_size == [400, 300]
    model = trimesh.load(io.BytesIO(widget.model_glb), file_type="glb")
    assert isinstance(model, trimesh.Scene) and model.geometry
    rle = widget.mask_rle
    mask = place.annotation.detection.mask
    assert mask is not None
    assert (decode_mask(rle["size"], runs_from_text(rle["counts"])) == mask).all()
    assert widget.pose_4dof == place.annotation.pose


def test_what_the_hand_does_comes_back(place: Place, small_library: Library) -> None:
    pytest.importorskip("anywidget")
    widget = cadpose.show(place.annotation, library=small_library, interactive=True)
    widget.set_state({"pose": {**widget.pose, "azimuth": 123.0, "principal_px": [10, 20]}, "opacity": 0.25})
    assert widget.pose_4dof.rotation.azimuth == 123.0
    assert widget.pose_4dof.principal_px == (10.0, 20.0)
    assert widget.opacity == 0.25


def test_several_objects_are_tabs(place: Place, small_library: Library) -> None:
    pytest.importorskip("anywidget")
    tabs = cadpose.show([place.annotation] * 2, library=small_library, interactive=True)
    assert tabs.titles == ("1 car", "2 car")
    assert len(tabs.children) == 2


def test_in_a_real_kernel(place: Place, small_library: Library) -> None:
    """The cell's output holds a widget, or the picture where it is asked for."""
    pytest.importorskip("ipykernel", reason="needs cadpose[test]")
    nbformat = pytest.importorskip("nbformat", reason="needs cadpose[test]")
    nbclient = pytest.importorskip("nbclient", reason="needs cadpose[test]")
    call = f"cadpose.show({str(place.document)!r}, library={str(small_library.path)!r}"
    cells = [f"import cadpose\n{call})", f"{call}, interactive=False)"]
    page = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(cell) for cell in cells])
    nbclient.NotebookClient(page, timeout=120, kernel_name="python3").execute()
    widget, picture = (cell["outputs"][-1]["data"] for cell in page["cells"])
    assert "application/vnd.jupyter.widget-view+json" in widget
    assert "image/png" in picture
