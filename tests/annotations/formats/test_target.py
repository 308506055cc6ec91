from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.annotations.formats.target import file_stem, new_file, new_folder, portable_name
from cadpose.errors import InputError
from tests.annotations.factory import make_document


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("a/b.jpg", "a/b.jpg"), ("/etc/passwd", "etc/passwd"), ("../../x.jpg", "x.jpg"),
        ("a/../b.jpg", "a/b.jpg"),
        ("C:\\photos\\x.jpg", "photos/x.jpg"), ("..\\x.jpg", "x.jpg"), ("./x.jpg", "x.jpg"), ("", "photo"),
        ("..", "photo"), ("/", "photo"), ("C:", "C:"), ("x.jpg", "x.jpg"),
    ],
)  # fmt: skip
def test_names_stay_below(name: str, told: str) -> None:
    assert portable_name(name) == told


@pytest.mark.parametrize(
    "name",
    ["../x", "/etc/passwd", "a\\..\\b", "x\n.png", "con", ".", "", "-rf", "a" * 400, "пицца", "\u202e.png"],
)
def test_stems_are_file_names(tmp_path: Path, name: str) -> None:
    stem = file_stem(make_document(name))
    (tmp_path / f"{stem}.json").write_text("x")
    assert [path.name for path in tmp_path.iterdir()] == [f"{stem}.json"]


def test_photos_of_one_name_do_not_meet() -> None:
    assert file_stem(make_document("a/x.jpg")) != file_stem(make_document("b/x.jpg"))


def test_a_file_is_whole_or_not_there(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "a.json"
    with new_file(out, False) as path:
        path.write_text("1")
        assert not out.exists() and path.suffix == ".json"
    assert out.read_text() == "1" and list(out.parent.iterdir()) == [out]
    with pytest.raises(InputError, match="there already"), new_file(out, False):
        pass
    with pytest.raises(ZeroDivisionError), new_file(out, True) as path:
        path.write_text("half")
        raise ZeroDivisionError
    assert out.read_text() == "1" and list(out.parent.iterdir()) == [out]
    with new_file(out, True) as path:
        path.write_text("2")
    assert out.read_text() == "2"
    for place in (tmp_path, out):
        with pytest.raises(InputError, match=r"choose another|name a file"), new_file(place, True, [out]):
            pass


def test_a_folder_is_whole_or_not_there(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with new_folder(out, False) as path:
        (path / "a").write_text("1")
        assert not out.exists()
    with pytest.raises(InputError, match="not empty"), new_folder(out, False):
        pass
    with pytest.raises(ZeroDivisionError), new_folder(out, True) as path:
        (path / "b").write_text("2")
        raise ZeroDivisionError
    assert [p.name for p in out.iterdir()] == ["a"] and list(tmp_path.iterdir()) == [out]
    with new_folder(out, True) as path:
        (path / "b").write_text("2")
    assert [p.name for p in out.iterdir()] == ["b"] and list(tmp_path.iterdir()) == [out]
    with pytest.raises(InputError, match="is a file"), new_folder(out / "b", True):
        pass


def test_an_empty_folder_is_filled(tmp_path: Path) -> None:
    out = tmp_path / "out"
    out.mkdir()
    with new_folder(out, False) as path:
        (path / "a").write_text("1")
    assert [p.name for p in out.iterdir()] == ["a"]


def test_what_is_read_is_not_replaced(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photos = tmp_path / "set" / "photos"
    photos.mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "set")
    for out in (photos.parent, tmp_path / "link"):
        with pytest.raises(InputError, match="cannot be replaced"), new_folder(out, True, [photos]):
            pass
    monkeypatch.chdir(photos)
    for place in (Path(), Path("..")):
        (photos / "x").write_text("1")
        with pytest.raises(InputError, match="cannot be replaced"), new_folder(place, True):
            pass
    assert photos.is_dir()


def test_a_folder_that_cannot_be_moved_in_leaves_the_old_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "old").write_text("1")
    rename = Path.rename

    def fail(self: Path, target: Path) -> Path:
        if self.suffix == ".part":
            raise OSError(28, "No space left on device")
        return rename(self, target)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(OSError, match="No space"), new_folder(out, True) as path:
        (path / "new").write_text("2")
    assert [p.name for p in out.iterdir()] == ["old"] and list(tmp_path.iterdir()) == [out]
