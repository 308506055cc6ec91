"""Hostile and damaged models, end to end: one sentence each, the right exit code, the others go on."""

from __future__ import annotations

import io
import json
import struct
import zipfile
from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
from tests.cli.invoking import cadpose, one_sentence, said
from tests.library.builders import CUBE, SQUARE, glb, png, triangle_gltf, write_sh3f

MATERIAL = "newmtl paint\nKd 1 0 0\nmap_Kd {}\n"


def escaping_gltf() -> bytes:
    header, _ = triangle_gltf(buffers=[{"byteLength": 36, "uri": "../../secret.bin"}])
    return json.dumps(header).encode()


@pytest.mark.parametrize(
    ("files", "says"),
    [
        ({"bad.obj": CUBE.replace("v 1 1 1", "v nan 1 1").encode()}, ["bad.obj"]),
        ({"bad.obj": b"v 0 0 0\nv 1 0 0\n"}, ["bad.obj", "no face"]),
        ({"bad.glb": b"glTF nonsense"}, ["bad.glb"]),
        ({"bad.gltf": escaping_gltf()}, ["bad.gltf", "secret.bin"]),
    ],
    ids=["NaN", "no faces", "no glTF", "../ in glTF"],
)
def test_models_that_cannot_be_used(tmp_path: Path, files: dict[str, bytes], says: list[str]) -> None:
    folder, library = tmp_path / "models", tmp_path / "library"
    folder.mkdir()
    (tmp_path / "secret.bin").write_bytes(b"\0" * 36)
    for name, content in files.items():
        (folder / name).write_bytes(content)
    # Alone: nothing could be added.
    result = cadpose("library", "add", folder, "--library", library)
    one_sentence(result, *says)
    assert "1 failed" in result.stdout and not list((library / "meshes").glob("*/*"))
    # With a good one: that one is added.
    (folder / "good.obj").write_text(CUBE)
    result = cadpose("library", "add", folder, "--library", library, "--json")
    assert result.exit_code == 0 and result.stderr.count("\n") == 1
    told = said(result)
    assert told["added"] == ["models/good.obj"] and len(told["failed"]) == 1
    assert cadpose("library", "check", "--library", library).exit_code == 0


@pytest.mark.parametrize(
    ("material", "files", "says"),
    [
        ("gone.png", {}, "gone.png"),
        ("broken.png", {"broken.png": b"\x89PNG nonsense"}, "broken.png"),
    ],
    ids=["missing", "damaged"],
)
def test_textures_that_cannot_be_used_are_told_and_the_colour_taken(
    tmp_path: Path, material: str, files: dict[str, bytes], says: str
) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "square.obj").write_text(SQUARE)
    (folder / "square.mtl").write_text(MATERIAL.format(material))
    for name, content in files.items():
        (folder / name).write_bytes(content)
    result = cadpose("library", "add", folder, "--library", tmp_path / "library")
    assert result.exit_code == 0 and "1 added" in result.stdout and "1 mended" in result.stdout
    assert says in result.stderr and "square.obj" in result.stderr and result.stderr.count("\n") == 1
    mesh = Library.open(tmp_path / "library").mesh("models/square.obj")
    assert all(m.texture is None for m in mesh.materials)
    assert mesh.materials[mesh.face_material[0]].rgba[:3] == pytest.approx((1.0, 0.0, 0.0), abs=0.01)


def test_a_texture_without_coordinates_colours_the_model(tmp_path: Path) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    (folder / "cube.obj").write_text("mtllib cube.mtl\nusemtl paint\n" + CUBE)
    (folder / "cube.mtl").write_text(MATERIAL.format("blue.png"))
    (folder / "blue.png").write_bytes(png((0, 0, 255)))
    result = cadpose("library", "add", folder, "--library", tmp_path / "library")
    assert result.exit_code == 0 and "1 added" in result.stdout
    assert result.stderr.count("\n") == 1 and "cube.obj" in result.stderr
    mesh = Library.open(tmp_path / "library").mesh("models/cube.obj")
    assert mesh.materials[mesh.face_material[0]].rgba[2] > 0.9


@pytest.mark.parametrize("reference", ["../secret.mtl", "../secret.png"])
def test_a_model_that_reaches_out_of_its_folder_is_refused(tmp_path: Path, reference: str) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    (tmp_path / "secret.png").write_bytes(png())
    (tmp_path / "secret.mtl").write_text(MATERIAL.format("secret.png"))
    is_mtl = reference.endswith(".mtl")
    (folder / "square.obj").write_text(SQUARE.replace("square.mtl", reference) if is_mtl else SQUARE)
    (folder / "square.mtl").write_text(MATERIAL.format(reference))
    result = cadpose("library", "add", folder, "--library", tmp_path / "library")
    one_sentence(result, "square.obj", reference)
    assert "0 added" in result.stdout and "1 failed" in result.stdout


def test_many_mended_models_are_summed_up(tmp_path: Path) -> None:
    folder = tmp_path / "models"
    folder.mkdir()
    for number in range(13):
        (folder / f"s{number}.obj").write_text(SQUARE.replace("square.mtl", f"gone{number}.mtl"))
    result = cadpose("library", "add", folder, "--library", tmp_path / "library", "--workers", 1)
    assert "13 added" in result.stdout and "13 mended" in result.stdout
    assert result.stderr.count("\n") == 11 and "3 more" in result.stderr


def test_an_archive_that_unpacks_to_gigabytes(tmp_path: Path) -> None:
    zeros = io.BytesIO()
    with zipfile.ZipFile(zeros, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        with archive.open("model.obj", "w", force_zip64=True) as stream:
            block = bytes(1 << 20)
            for _ in range(64):
                stream.write(block)
        archive.writestr(
            "PluginFurnitureCatalog.properties", "name#1=Bomb\ncategory#1=Chair\nmodel#1=/model.obj"
        )
    bomb = tmp_path / "bomb.sh3f"
    # What the directory says is a lie of four gigabytes, what is packed are 64 megabytes of zeros.
    content = zeros.getvalue().replace(struct.pack("<I", 64 << 20), struct.pack("<I", (4 << 30) - 2))
    bomb.write_bytes(content)
    assert len(content) < 200_000
    library = tmp_path / "library"
    result = cadpose("library", "add", bomb, "--library", library)
    one_sentence(result, "bomb.sh3f")
    assert not list((library / "meshes").glob("*/*"))
    # Beside a good archive, the good one's models come in.
    write_sh3f(
        tmp_path / "good.sh3f",
        [{"name": "A", "category": "Chair", "model": "/a.obj"}],
        {"a.obj": CUBE.encode()},
    )
    result = cadpose("library", "add", tmp_path, "--library", library)
    assert result.exit_code == 0 and "1 added" in result.stdout
    assert "bomb.sh3f" in result.stderr and result.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["gone"], "gone does not exist"),
        (["empty"], "empty holds no mesh file"),
        (["notes.txt"], "notes.txt is no mesh file"),
        (["models", "--front", "sideways"], "sideways"),
        (["models", "--table", "gone.csv"], "gone.csv"),
        (["models", "--category", "zebra"], "zebra"),
    ],
)
def test_sources_that_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    (tmp_path / "notes.txt").write_text("hello")
    (tmp_path / "models").mkdir()
    (tmp_path / "models" / "cube.obj").write_text(CUBE)
    one_sentence(cadpose("library", "add", *arguments, "--library", tmp_path / "library"), says)


def test_a_glb_is_read_for_comparison(tmp_path: Path) -> None:
    """The glTF checks above fail for what is wrong with their files, not for their making."""
    (tmp_path / "good.glb").write_bytes(glb(*triangle_gltf()))
    result = cadpose("library", "add", tmp_path / "good.glb", "--library", tmp_path / "library")
    assert result.exit_code == 0 and "1 added" in result.stdout
