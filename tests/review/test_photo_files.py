"""Photos are found by content, in the named folders alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError
from cadpose.review import photo_files
from cadpose.review.desk import photo_folders
from cadpose.review.photo_files import PhotoFiles
from tests.review.serving import digest
from tests.small_library import save


def put(path: Path, name: str = "a") -> str:
    """A photo at that place; its digest."""
    rgb = np.random.default_rng(list(name.encode())).integers(0, 255, (20, 30, 3), np.uint8)
    return digest(save(path, rgb).read_bytes())


@pytest.fixture
def files(tmp_path: Path) -> PhotoFiles:
    (tmp_path / "photos").mkdir()
    return PhotoFiles([tmp_path / "photos", tmp_path / "up"], tmp_path / "up")


@pytest.mark.parametrize("name", ["a.png", "in/a.png", "/srv/in/a.png", "../../in/a.png", "C:\\in\\a.png"])
def test_by_name(files: PhotoFiles, tmp_path: Path, name: str) -> None:
    place = tmp_path / "photos" / ("a.png" if name == "a.png" else "in/a.png")
    sha256 = put(place)
    assert files.path(sha256, name) == place
    assert files.read(sha256, name).sha256 == sha256


def test_by_content_where_the_name_is_another(files: PhotoFiles, tmp_path: Path) -> None:
    sha256 = put(tmp_path / "photos" / "deep" / "down" / "b.png")
    put(tmp_path / "photos" / "a.png", "other")
    assert files.path(sha256, "a.png", patience=10.0) == tmp_path / "photos/deep/down/b.png"
    assert files.read(sha256, "a.png").sha256 == sha256


def test_uploads_are_named_by_their_digest(files: PhotoFiles, tmp_path: Path) -> None:
    place = tmp_path / "up" / "x.png"
    sha256 = put(place)
    place.rename(place.with_name(f"{sha256}.png"))
    assert files.path(sha256, "holiday.jpg") == tmp_path / "up" / f"{sha256}.png"


def test_a_changed_file_is_no_longer_it(files: PhotoFiles, tmp_path: Path) -> None:
    place = tmp_path / "photos" / "a.png"
    sha256 = put(place)
    assert files.path(sha256, "a.png") == place
    put(place, "another")
    assert files.path(sha256, "a.png", patience=10.0) is None
    with pytest.raises(InputError, match="--photos"):
        files.read(sha256, "a.png")


def test_a_photo_that_moves_is_found_again(
    files: PhotoFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(photo_files, "FRESH", 0.0)
    place, renamed = tmp_path / "photos" / "a.png", tmp_path / "photos" / "in" / "b.png"
    sha256 = put(place)
    assert files.path(sha256, "a.png") == place
    renamed.parent.mkdir()
    for old, new in ((place, renamed), (renamed, place.with_name("c.png"))):
        old.rename(new)
        assert files.path(sha256, "a.png", patience=10.0) == new
        assert files.read(sha256, "a.png").sha256 == sha256


def test_nothing_outside_is_given(files: PhotoFiles, tmp_path: Path) -> None:
    secret = tmp_path / "secret.png"
    sha256 = put(secret)
    (tmp_path / "photos" / "link.png").symlink_to(secret)
    (tmp_path / "photos" / "folder").symlink_to(tmp_path, target_is_directory=True)
    for name in (
        "link.png",
        "../secret.png",
        "folder/secret.png",
        str(secret),
        "secret.png",
        "\x00",
        "a" * 5000,
    ):
        assert files.path(sha256, name, patience=10.0) is None, name


def test_a_link_within_the_folders_is_followed(files: PhotoFiles, tmp_path: Path) -> None:
    sha256 = put(tmp_path / "photos" / "a.png")
    link = tmp_path / "photos" / "link.png"
    link.symlink_to(tmp_path / "photos" / "a.png")
    assert files.path(sha256, "link.png") == link


def test_hidden_files_and_other_kinds_are_not_looked_through(files: PhotoFiles, tmp_path: Path) -> None:
    for name in (".git/a.png", ".hidden.png", "notes.txt"):
        sha256 = put(tmp_path / "photos" / (name if name != "notes.txt" else "n.png"), name)
        if name == "notes.txt":
            (tmp_path / "photos" / "n.png").rename(tmp_path / "photos" / name)
        assert files.path(sha256, "gone.png", patience=10.0) is None


def test_walks_are_bounded(files: PhotoFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(photo_files, "MOST_FILES", 2)
    digests = [put(tmp_path / "photos" / f"{number}.png", str(number)) for number in range(4)]
    found = [files.path(sha256, "gone.png", patience=10.0) for sha256 in digests]
    assert [path is not None for path in found] == [True, True, False, False]
    # A photo that is looked for again soon does not start a walk again.
    assert files._walking() is None
    monkeypatch.setattr(photo_files, "FRESH", 0.0)
    monkeypatch.setattr(photo_files, "MOST_FILES", 9)
    assert files.path(digests[3], "gone.png", patience=10.0) is not None


def test_what_is_too_large_is_left_alone(
    files: PhotoFiles, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    sha256 = put(tmp_path / "photos" / "a.png")
    monkeypatch.setattr(photo_files, "MAX_BYTES", 10)
    assert files.path(sha256, "a.png", patience=10.0) is None


def test_a_file_that_is_no_photo(files: PhotoFiles, tmp_path: Path) -> None:
    (tmp_path / "photos" / "a.png").write_bytes(b"no photo")
    sha256 = digest(b"no photo")
    assert files.path(sha256, "a.png") is not None
    with pytest.raises(InputError, match="not at hand"):
        files.read(sha256, "a.png")


def test_default_folders(tmp_path: Path) -> None:
    file = tmp_path / "s.db"
    assert photo_folders(file, []) == ([tmp_path, tmp_path / "s.db.photos"], tmp_path / "s.db.photos")
    told = tmp_path / "p"
    assert photo_folders(file, [told])[0] == [told, tmp_path / "s.db.photos"]
    folders, uploads = photo_folders(None, [told])
    assert folders == [told, uploads] and uploads.name == "photos"
