"""What goes out comes back, in every format as far as it can carry it."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.registry import FORMATS, documents_from, export
from cadpose.annotations.store import Store
from cadpose.errors import InputError
from tests.annotations.formats.made import Made

#: Formats that bring every document back as it was.
WHOLE = ("coco", "pascal3d", "label-studio", "fiftyone", "gltf", "usd")
#: Formats with entries for objects alone: photos without one are lost, and in tables what failed.
OBJECTS = {"bop": True, "pix3d": True, "parquet": False, "csv": False}


def without_failures(document: AnnotationDocument) -> AnnotationDocument:
    return document.model_copy(update={"failures": ()})


def test_every_format_is_tried() -> None:
    assert {name for name, kind in FORMATS.items() if kind.read} == {*WHOLE, *OBJECTS}


@pytest.mark.parametrize("name", WHOLE)
def test_whole_documents_come_back(made: Made, tmp_path: Path, name: str) -> None:
    again = made.again(name, tmp_path / "out")
    assert sorted(again, key=lambda d: d.photo.sha256) == sorted(made.documents, key=lambda d: d.photo.sha256)


@pytest.mark.parametrize("name", OBJECTS)
def test_objects_come_back(made: Made, tmp_path: Path, name: str) -> None:
    again = made.again(name, tmp_path / "out")
    assert [d.photo for d in again] == [d.photo for d in made.documents[:3]]
    for told, document in zip(again, made.documents, strict=False):
        if name == "csv":
            assert len(told.annotations) == len(document.annotations)
            continue
        assert told.annotations == document.annotations
        assert told.failures == (document.failures if OBJECTS[name] else ())


@pytest.mark.parametrize("name", [*WHOLE, "bop", "pix3d", "parquet"])
def test_a_store_that_is_imported_into_has_nothing_new(made: Made, tmp_path: Path, name: str) -> None:
    """The digests by which a store knows a document are the same to the last bit."""
    with Store(f"sqlite:///{tmp_path / 'kept.db'}") as store:
        documents = made.documents if name in WHOLE else made.documents[:3]
        if name == "parquet":
            documents = tuple(without_failures(d) for d in documents)
        assert all(store.add(document) for document in documents)
        assert not any(store.add(document) for document in made.again(name, tmp_path / "out"))


@pytest.mark.parametrize("name", FORMATS)
def test_nothing_to_export(made: Made, tmp_path: Path, name: str) -> None:
    out = tmp_path / "out"
    with pytest.raises(InputError, match="no annotation to export"):
        export(name, made.documents[3:], out, made.sources)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", FORMATS)
def test_what_is_no_export(tmp_path: Path, name: str) -> None:
    """One sentence with the file's name, whatever is read."""
    for number, content in enumerate(
        (b"", b"[]x", b"{", b"[1]", b'{"images": 3}', b"\xff\xfe", b"[[[[", b'{"a":NaN}')
    ):
        path = tmp_path / f"{number}"
        if FORMATS[name].folder:
            path.mkdir()
            (path / "samples.json").write_bytes(content)
            (path / "pix3d.json").write_bytes(content)
            scene = path / "test" / "000001"
            scene.mkdir(parents=True)
            for file in ("cadpose.jsonl", "scene_gt.json", "scene_camera.json"):
                (scene / file).write_bytes(content if number else b"{}")
        else:
            path.write_bytes(content)
        with pytest.raises(InputError, match=str(path)) as caught:
            found = list(documents_from(name, path))
            # What holds no entry at all is empty and not wrong.
            assert found == []
            raise InputError(str(path))
        assert "\n" not in str(caught.value)
    with pytest.raises(InputError, match="nowhere"):
        list(documents_from(name, tmp_path / "nowhere"))
