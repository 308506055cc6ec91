"""Hostile and damaged input, end to end: one sentence each, the right exit code, the others go on."""

from __future__ import annotations

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import Result

from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from tests.cli.test_verbs import cadpose, given, said
from tests.library.builders import CUBE, SQUARE, glb, png, triangle_gltf, write_sh3f
from tests.small_library import Shot, save, shoot


@pytest.fixture(scope="module")
def hatch(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))


def one_sentence(result: Result, *words: object) -> None:
    """Exit code 1 and one line on stderr that holds the words."""
    assert isinstance(result.exception, SystemExit), result.exception
    assert result.exit_code == 1
    assert result.stderr.startswith("cadpose: ") and result.stderr.count("\n") == 1, result.stderr
    for word in words:
        assert str(word) in result.stderr
    assert "Traceback" not in result.output


# -- photos ----------------------------------------------------------------------------------------


def huge_png() -> bytes:
    """400 megapixels in half a megabyte."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    side = 20_000
    row = b"\0" * (side + 1)
    packer = zlib.compressobj(9)
    body = b"".join(packer.compress(row * 100) for _ in range(side // 100)) + packer.flush()
    header = struct.pack(">IIBBBBB", side, side, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


def truncated(photo: bytes) -> bytes:
    return photo[: len(photo) // 2]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda photo: b"#!/bin/sh\necho no photo\n", "is not a photo"),
        (truncated, "damaged or cut short"),
        (lambda photo: b"", "is empty (0 bytes)"),
        (lambda photo: huge_png(), "megapixels, more than the limit"),
    ],
    ids=["not an image", "truncated", "0 bytes", "400 megapixels"],
)
def test_photos_that_cannot_be_used(
    small_library: Library, hatch: Shot, tmp_path: Path, make: Callable[[bytes], bytes], says: str
) -> None:
    good = save(tmp_path / "b.png", hatch.photo.rgb)
    bad = tmp_path / "a.jpg"
    bad.write_bytes(make(good.read_bytes()))
    out = tmp_path / "out"
    common = [bad, good, "--json"]
    result = cadpose("annotate", *common, "--library", small_library.path, "--out", out, *given(hatch))
    one_sentence(result, bad, says)
    first, second = json.loads(result.stdout)
    assert says in first["error"] and "annotations" not in first
    assert [a["cad"] for a in second["annotations"]] == ["made/car/hatch.obj"]
    assert {p.name.split(".")[0] for p in out.iterdir()} == {"b", "index"}
    if says != "megapixels":
        result = cadpose("detect", bad)
        one_sentence(result, bad, says)
        assert "failed" in result.stdout


def cmyk(rgb: Image.Image) -> Image.Image:
    return rgb.convert("CMYK")


def deep(rgb: Image.Image) -> Image.Image:
    return Image.fromarray(np.asarray(rgb.convert("L")).astype(np.uint16) * 257)


@pytest.mark.parametrize(
    ("name", "convert"),
    [
        ("cmyk.jpg", cmyk),
        ("deep.png", deep),
        ("grey.png", lambda rgb: rgb.convert("L")),
        ("palette.gif", lambda rgb: rgb.convert("P")),
        ("alpha.png", lambda rgb: rgb.convert("RGBA")),
    ],
)
def test_unusual_photos_give_the_usual_answer(
    small_library: Library,
    hatch: Shot,
    tmp_path: Path,
    name: str,
    convert: Callable[[Image.Image], Image.Image],
) -> None:
    path = tmp_path / name
    convert(Image.fromarray(hatch.photo.rgb)).save(path)
    arguments = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch), "--json"]
    result = cadpose("annotate", path, *arguments)
    assert result.exit_code == 0 and result.stderr == ""
    (told,) = said(result)
    assert [a["cad"] for a in told["annotations"]] == ["made/car/hatch.obj"]
    assert told["annotations"][0]["box"] == pytest.approx(hatch.box.to_tuple())


def test_an_animated_photo_is_read_once_and_said_so(
    small_library: Library, hatch: Shot, tmp_path: Path
) -> None:
    path = tmp_path / "moving.gif"
    first = Image.fromarray(hatch.photo.rgb)
    first.save(path, save_all=True, append_images=[Image.new("RGB", first.size)] * 2, duration=50)
    arguments = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch), "--json"]
    result = cadpose("annotate", path, *arguments)
    assert result.exit_code == 0
    assert result.stderr == f"cadpose: {path} holds several frames; only the first one is used\n"
    assert [a["cad"] for a in said(result)[0]["annotations"]] == ["made/car/hatch.obj"]


def test_boxes_are_those_of_the_upright_photo(small_library: Library, hatch: Shot, tmp_path: Path) -> None:
    """The file's pixels lie on their side, its EXIF says how to turn them."""
    path = tmp_path / "turned.png"
    exif = Image.Exif()
    exif[0x0112] = 6  # turn by 90 degrees clockwise to see it upright
    Image.fromarray(hatch.photo.rgb).transpose(Image.Transpose.ROTATE_90).save(path, exif=exif)
    assert Image.open(path).size == (300, 400)
    arguments = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch), "--json"]
    (told,) = said(cadpose("annotate", path, *arguments))
    (found,) = told["annotations"]
    assert found["cad"] == "made/car/hatch.obj" and found["box_iou"] > 0.95 and found["mask_iou"] > 0.85
    document = json.loads((tmp_path / "out" / "turned.json").read_text())
    assert document["photo"]["size"] == [400, 300]
    overlay = Image.open(tmp_path / "out" / "turned.overlay.png")
    assert overlay.width > overlay.height


def test_a_box_outside_one_photo_only(small_library: Library, hatch: Shot, tmp_path: Path) -> None:
    large = save(tmp_path / "large.png", hatch.photo.rgb)
    small = save(tmp_path / "small.png", hatch.photo.rgb[:50, :50])
    arguments = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch), "--json"]
    result = cadpose("annotate", small, large, *arguments)
    one_sentence(result, small, "lies outside", "50 x 50")
    assert len(json.loads(result.stdout)[1]["annotations"]) == 1


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (["nothing.jpg"], "there is no file or folder nothing.jpg"),
        (["empty"], "the folder empty holds no photo"),
        (["*.jpg"], "no photo matches *.jpg"),
        (["x" * 300], "x" * 300),
    ],
)
def test_names_that_stand_for_no_photo(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], says: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    one_sentence(cadpose("annotate", *arguments, "--library", small_library.path), says)
    one_sentence(cadpose("detect", *arguments), says)
    assert not (tmp_path / "runs").exists()


# -- places ----------------------------------------------------------------------------------------


@pytest.fixture
def street(hatch: Shot, tmp_path: Path) -> Path:
    return save(tmp_path / "street.png", hatch.photo.rgb)


def test_libraries_that_cannot_be_used(street: Path, tmp_path: Path) -> None:
    missing = tmp_path / "none"
    one_sentence(cadpose("annotate", street, "--library", missing), missing, "cadpose library add")
    assert not missing.exists()
    empty = tmp_path / "empty"
    Library.create(empty)
    for verb in (["annotate", street], ["library", "list"], ["library", "check"], ["library", "show"]):
        one_sentence(cadpose(*verb, "--library", empty), empty, "is empty", "cadpose library add")
    damaged = tmp_path / "damaged"
    damaged.mkdir()
    (damaged / "index.sqlite").write_bytes(b"no database at all" * 100)
    one_sentence(cadpose("library", "list", "--library", damaged), damaged, "cannot be used")
    one_sentence(cadpose("library", "add", tmp_path, "--library", street), street, "cannot be made")
    one_sentence(cadpose("library", "add", tmp_path, "--library", "/proc/cadpose"), "/proc/cadpose")


def test_out_is_a_file(small_library: Library, street: Path, tmp_path: Path) -> None:
    taken = tmp_path / "taken"
    taken.write_text("mine")
    result = cadpose("annotate", street, "--library", small_library.path, "--out", taken, "--box", "0,0,9,9")
    one_sentence(result, taken, "--out")
    one_sentence(cadpose("detect", street, "--out", taken), taken, "--out")
    sheet = taken / "sheet.png"
    one_sentence(cadpose("library", "show", "--library", small_library.path, "--out", sheet), sheet, "--out")
    assert taken.read_text() == "mine"


@pytest.mark.parametrize(
    ("store", "says"),
    [
        ("nonsense", "sqlite:///file.db"),
        ("postgresql://somewhere/db", "sqlite:///file.db"),
        ("sqlite:////proc/none/file.db", "/proc/none"),
        ("sqlite:///{street}", "street.png"),
    ],
)
def test_stores_that_cannot_be_used(
    small_library: Library, hatch: Shot, street: Path, tmp_path: Path, store: str, says: str
) -> None:
    before = street.read_bytes()
    result = cadpose(
        "annotate",
        street,
        *["--library", small_library.path, "--out", tmp_path / "out", *given(hatch)],
        *["--store", store.format(street=street)],
    )
    one_sentence(result, says)
    assert street.read_bytes() == before and not result.stdout


@pytest.mark.parametrize("content", [None, "", "{", "[]", '{"images": 3}', "\x00\xff"])
def test_detections_files_that_cannot_be_used(
    small_library: Library, street: Path, tmp_path: Path, content: str | None
) -> None:
    file = tmp_path / "boxes.json"
    if content is not None:
        file.write_text(content)
    one_sentence(cadpose("annotate", street, "--library", small_library.path, "--detections", file), file)


# -- models ----------------------------------------------------------------------------------------

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
