"""Hostile and damaged photos and places, end to end: one sentence, the right exit code, the others go on."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.library.catalogue import Library
from cadpose.records import Rotation
from tests.cli.invoking import cadpose, given, one_sentence, said
from tests.small_library import Shot, save, shoot


@pytest.fixture(scope="module")
def hatch(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))


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
    # Of the bad photo only why it failed is kept.
    assert [p.name for p in out.glob("a.*")] == ["a.failed.json"]
    assert (out / "b.json").is_file()
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
