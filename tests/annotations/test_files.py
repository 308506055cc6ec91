from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cadpose.annotations.files import output_paths, write_atomic
from cadpose.errors import CadposeError


def test_writes_and_replaces_and_makes_folders(tmp_path: Path) -> None:
    path = tmp_path / "a" / "b" / "x.json"
    write_atomic(path, b"one")
    write_atomic(path, b"two")
    assert path.read_bytes() == b"two"
    assert [p.name for p in path.parent.iterdir()] == ["x.json"]


@pytest.mark.skipif(os.name != "posix", reason="umask is a POSIX thing")
def test_permissions_follow_the_umask(tmp_path: Path) -> None:
    old = os.umask(0o022)
    try:
        write_atomic(tmp_path / "x", b"")
    finally:
        os.umask(old)
    assert stat.S_IMODE((tmp_path / "x").stat().st_mode) == 0o644


@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_failure_leaves_the_old_file_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    path = tmp_path / "x.json"
    write_atomic(path, b"old")

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os if step == "fsync" else Path, step, full)
    with pytest.raises(CadposeError, match=r"cannot write .*x\.json: No space left on device; choose"):
        write_atomic(path, b"new")
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["x.json"]


def test_an_interrupt_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupt)
    with pytest.raises(KeyboardInterrupt):
        write_atomic(tmp_path / "x.json", b"new")
    assert not list(tmp_path.iterdir())


def test_a_folder_that_is_a_file_gives_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(CadposeError, match="cannot write"):
        write_atomic(tmp_path / "file" / "x.json", b"")
    with pytest.raises(CadposeError, match="cannot write"):
        write_atomic(tmp_path / "nul\0byte", b"")


def stems(*photos: str) -> list[str]:
    return [paths.json.name.removesuffix(".json") for paths in output_paths(photos, "out")]


def test_a_photo_keeps_its_stem() -> None:
    (paths,) = output_paths(["photos/red car.v2.JPEG"], "runs/photos")
    assert paths.json == Path("runs/photos/red_car.v2.json")
    assert paths.overlay.name == "red_car.v2.overlay.png"
    assert paths.candidates.name == "red_car.v2.candidates.png"
    assert paths.card.name == "red_car.v2.card.html"


def test_photos_that_share_a_stem_are_told_apart_whatever_their_order() -> None:
    names = ["a/car.jpg", "b/CAR.jpg", "b/car.png", "b/bus.jpg"]
    forward, backward = stems(*names), stems(*reversed(names))
    assert forward == backward[::-1]
    assert forward[3] == "bus"
    assert len({stem.casefold() for stem in forward}) == 4
    assert all(stem.casefold().startswith("car-") for stem in forward[:3])
    taken = stems("a/car.jpg", "b/car.jpg", f"c/{stems('a/car.jpg', 'b/car.jpg')[0]}.jpg")
    assert len(set(taken)) == 3


def test_the_same_path_twice_is_one_photo() -> None:
    assert stems("a/car.jpg", "a/./car.jpg") == ["car", "car"]


@pytest.mark.parametrize(
    ("name", "stem"),
    [
        ("../../etc/passwd", "passwd"),
        ("..", "photo"),
        (".hidden.jpg", "hidden"),
        ("a\\b\\car.jpg", "car"),
        ("<script>alert(1)</script>.jpg", "script"),
        ('"x" & \n.jpg', "x"),
        ("con.jpg", "con_"),
        ("Стул.jpg", "Стул"),
        ("-rf.jpg", "rf"),
        ("x" * 300 + ".jpg", "x" * 120),
        ("é" * 300 + ".jpg", "é" * 60),
    ],
)
def test_hostile_names_are_made_safe(name: str, stem: str) -> None:
    assert stems(name) == [stem]


@given(st.lists(st.text(min_size=1).filter(lambda s: "\0" not in s), max_size=6))
def test_no_two_photos_share_an_output_and_none_leaves_the_folder(names: list[str]) -> None:
    paths = output_paths(names, "out")
    assert len({p.json.name.casefold() for p in paths}) == len({os.path.normpath(n) for n in names})
    for p in paths:
        for path in (p.json, p.overlay, p.candidates, p.card):
            assert path.parent == Path("out")
            assert not path.name.startswith((".", "-"))
            assert len(os.fsencode(path.name)) <= 200
