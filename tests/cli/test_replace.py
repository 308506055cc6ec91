"""``cadpose replace``: its files, its JSON, and its errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.document import document_from
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from tests.cli.invoking import cadpose, one_sentence, said
from tests.replacement.scenes import VAN, annotated, cad_id, street
from tests.small_library import save


@pytest.fixture(scope="module")
def photo(small_library: Library, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A photo with the document of its annotation beside it."""
    folder = tmp_path_factory.mktemp("replace")
    shot = street(small_library).shot
    path = save(folder / "street.png", shot.photo.rgb)
    read = read_photo(path)
    told = document_from(read, [annotated(read, shot.cad, shot.mask, shot)])
    (folder / "street.json").write_text(told.to_json())
    return path


def arguments(photo: Path, library: Library, model: str = "van") -> list[object]:
    document = photo.with_suffix(".json")
    return ["replace", photo, "--with", model, "--annotation", document, "--library", library.path]


def test_every_file_is_written(photo: Path, small_library: Library, tmp_path: Path) -> None:
    out, scene, background = tmp_path / "new" / "van.png", tmp_path / "van.glb", tmp_path / "empty.png"
    van = cad_id(small_library, VAN)
    told = said(
        cadpose(
            *arguments(photo, small_library, van),
            *("--out", out, "--scene", scene, "--background", background, "--json"),
        )
    )
    assert told["cad"]["id"] == van and told["category"] == "car"
    assert set(told["files"]) == {"picture", "sheet", "scene", "background"}
    assert told["pose"]["azimuth"] == pytest.approx(40.0)
    with Image.open(out) as picture, Image.open(background) as empty:
        assert picture.size == empty.size == (400, 300)
        assert not picture.getexif() and not picture.info.get("exif")
        assert (np.asarray(picture) != np.asarray(empty)).any()
    with Image.open(out.with_suffix(".sheet.png")) as sheet:
        assert sheet.width > 3 * 400
    assert scene.read_bytes()[:4] == b"glTF"


def test_a_name_will_do(photo: Path, small_library: Library, tmp_path: Path) -> None:
    result = cadpose(
        *arguments(photo, small_library, "VAN"), "--out", tmp_path / "o.png", "--no-shadow", "--no-light"
    )
    assert result.exit_code == 0, result.output
    assert "car of" in result.stdout and (tmp_path / "o.png").is_file()


def test_mistakes_are_told(photo: Path, small_library: Library, tmp_path: Path) -> None:
    out = ["--out", tmp_path / "o.png"]
    told = arguments(photo, small_library)
    one_sentence(cadpose(*arguments(photo, small_library, "spaceship"), *out), "spaceship")
    one_sentence(cadpose(*told, *out, "--object", 7), "no object 7", "1 car")
    one_sentence(cadpose(*told, *out, "--category", "chair"), "no chair", "1 car")
    one_sentence(cadpose(*told, *out, "--size", "real"), "size", "--size match")
    one_sentence(cadpose(*told, "--out", tmp_path / "o.jpg"), "must end in .png", "--out")
    one_sentence(cadpose(*told, *out, "--scene", tmp_path / "o.gltf"), "must end in .glb")
    one_sentence(cadpose(*told, "--out", photo), "written over")
    one_sentence(cadpose(*told, *out, "--background", tmp_path / "o.png"), "--background")
    assert not (tmp_path / "o.png").exists()


def test_a_document_of_another_photo(photo: Path, small_library: Library, tmp_path: Path) -> None:
    other = save(tmp_path / "other.png", np.zeros((300, 400, 3), np.uint8))
    told = arguments(photo, small_library)
    told[1] = other
    one_sentence(cadpose(*told, "--out", tmp_path / "o.png"), "not of", "other.png")
    told[5] = tmp_path / "missing.json"
    one_sentence(cadpose(*told, "--out", tmp_path / "o.png"), "missing.json", "cannot be read")


def test_an_object_without_a_mask(photo: Path, small_library: Library, tmp_path: Path) -> None:
    read, shot = read_photo(photo), street(small_library).shot
    bare = tmp_path / "bare.json"
    bare.write_text(document_from(read, [annotated(read, shot.cad, None, shot)]).to_json())
    told = arguments(photo, small_library)
    told[5] = bare
    one_sentence(cadpose(*told, "--out", tmp_path / "o.png"), "has no mask", "--masks network")


def test_two_models_of_one_name() -> None:
    from cadpose.errors import InputError
    from cadpose.records import CadModel
    from cadpose.replacement.choosing import model_named

    class Two:
        def models(self) -> tuple[CadModel, ...]:
            return tuple(CadModel(f"lib/{i}.obj", "Sofa", "sofa") for i in range(6))

    with pytest.raises(InputError, match=r"6 models are called 'sofa'.*lib/0\.obj.*and 2 more"):
        model_named(Two(), "sofa")  # type: ignore[arg-type]
