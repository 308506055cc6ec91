"""Lists of photos: one path a line, from a file or from stdin, friendly or not."""

from __future__ import annotations

import io
import os
import sys
from pathlib import Path

import pytest

from cadpose.batch import photo_list
from cadpose.batch.photo_list import named_photos, read_list
from cadpose.errors import InputError
from tests.batch.fakes import picture


def read(data: bytes) -> list[str]:
    return [str(path) for path in read_list(io.BytesIO(data), "list.txt")]


@pytest.mark.parametrize(
    ("data", "wanted"),
    [
        (b"a.jpg\nb/c d.png\n", ["a.jpg", "b/c d.png"]),
        (b"\xef\xbb\xbfa.jpg\r\n\r\n  \n#b.jpg", ["a.jpg", "#b.jpg"]),
        (b"~x.jpg\n~/y.jpg\n", ["~x.jpg", "~/y.jpg"]),
        (b"caf\xe9.jpg\n", [os.fsdecode(b"caf\xe9.jpg")]),
    ],
    ids=["plain", "of another system", "tilde", "no text"],
)
def test_a_list_names_one_photo_a_line(data: bytes, wanted: list[str]) -> None:
    assert read(data) == wanted


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "names no photo"),
        (b"\n \n", "names no photo"),
        (b"a.jpg\n\x89PNG\0\0", "line 2: not a path"),
        (b"a" * 5000, "line 1: longer than 4096 bytes"),
    ],
)
def test_what_is_no_list_is_told_in_a_sentence(data: bytes, words: str) -> None:
    with pytest.raises(InputError, match=rf"list\.txt.*{words}"):
        read(data)


def test_a_list_has_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_list, "MAX_PHOTOS", 3)
    assert len(read(b"a\nb\nc\n")) == 3
    with pytest.raises(InputError, match="longer than 3 paths"):
        read(b"a\nb\nc\nd\n")


def test_lists_stand_beside_photos_and_folders(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = (picture(tmp_path / "in" / name) for name in ("a.png", "b.png"))
    listed = tmp_path / "photos.TXT"
    listed.write_text(f"{second}\n{tmp_path / 'missing.png'}\n")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(f"{first}\n".encode())))
    # A photo that is missing fails when it is read; each photo is taken once.
    assert named_photos([str(listed), "-", str(tmp_path / "in")]) == [
        second,
        tmp_path / "missing.png",
        first,
    ]
    with pytest.raises(InputError, match="more than once"):
        named_photos(["-", "-"])
    with pytest.raises(InputError, match="no file or folder"):
        named_photos([str(tmp_path / "none.txt")])
