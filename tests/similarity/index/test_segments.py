from __future__ import annotations

import errno
import json
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import InputError, LibraryError
from cadpose.similarity.index.segments import MANIFEST, Entry, Segment, SegmentStore


def segment(*names: str) -> Segment:
    rng = np.random.default_rng(len(names))
    return Segment(
        tuple(Entry(name, "car", f"sha-{name}") for name in names),
        rng.normal(size=(len(names), 2, 128)).astype(np.float16),
        rng.integers(-9, 9, (len(names), 2, 7, 7, 25), dtype=np.int8),
        rng.random((len(names), 2), np.float32),
    )


@pytest.fixture
def store(tmp_path: Path) -> SegmentStore:
    made = SegmentStore.create(tmp_path / "index", {"azimuths": 2})
    made.commit([segment("a", "b"), segment("c")])
    return made


def test_what_is_written_is_read(store: SegmentStore) -> None:
    again = SegmentStore.open(store.folder)
    assert again.names == ("000001", "000002") and again.settings == {"azimuths": 2}
    read, wrote = again.read("000001"), segment("a", "b")
    assert read.entries == wrote.entries
    for part in ("embeddings", "cells", "aspects"):
        np.testing.assert_array_equal(getattr(read, part), getattr(wrote, part))
    again.check("000001")


def test_segments_change_all_at_once(store: SegmentStore) -> None:
    store.commit([segment("d")], ["000001"])
    again = SegmentStore.open(store.folder)
    assert [e.id for name in again.names for e in again.read(name).entries] == ["c", "d"]
    assert not list(store.folder.glob("000001.*"))


def test_what_a_killed_run_left_is_swept_away(store: SegmentStore) -> None:
    for name in ("000003.cells.npy", ".part-x1_y2z3a"):
        (store.folder / name).write_bytes(b"half")
    before = SegmentStore.open(store.folder)
    assert before.names == store.names
    before.commit()
    assert not list(store.folder.glob("000003*")) and not (store.folder / ".part-x1_y2z3a").exists()


def test_files_of_others_are_left_alone(store: SegmentStore, tmp_path: Path) -> None:
    own = [
        store.folder / name for name in ("2024.jpg", "000009.txt", "000009.depth.npy", ".part-of-my-thesis")
    ]
    for path in own:
        path.write_bytes(b"mine")
    store.commit([segment("d")], ["000001"])
    assert all(path.read_bytes() == b"mine" for path in own)
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "000001.json").write_bytes(b"mine")
    with pytest.raises(InputError, match="holds something else"):
        SegmentStore.create(photos, {})
    assert [path.name for path in photos.iterdir()] == ["000001.json"]


@pytest.mark.parametrize("file", ["000001.embeddings.npy", "000001.cells.npy", "000001.json"])
def test_a_damaged_segment_is_told_in_a_sentence(store: SegmentStore, file: str) -> None:
    path = store.folder / file
    whole = path.read_bytes()
    for damage in (whole[:-7], b"", None):
        if damage is None:
            path.unlink()
        else:
            path.write_bytes(damage)
        with pytest.raises(LibraryError, match="damaged") as told:
            SegmentStore.open(store.folder).read("000001")
        assert str(path) in str(told.value) and "cadpose library index" in str(told.value)
    path.write_bytes(whole[:-1] + bytes([whole[-1] ^ 1]))
    with pytest.raises(LibraryError, match="damaged"):
        store.check("000001")


@pytest.mark.parametrize("text", ["", "{", "[]", '{"format": 1, "settings": {}, "segments": {"../x": ""}}'])
def test_a_damaged_manifest_is_told_in_a_sentence(store: SegmentStore, text: str) -> None:
    (store.folder / MANIFEST).write_text(text)
    with pytest.raises(LibraryError, match="damaged"):
        SegmentStore.open(store.folder)


def test_no_index_and_one_of_another_version(store: SegmentStore, tmp_path: Path) -> None:
    with pytest.raises(LibraryError, match="cadpose library index"):
        SegmentStore.open(tmp_path / "none")
    told = json.loads((store.folder / MANIFEST).read_text())
    (store.folder / MANIFEST).write_text(json.dumps({**told, "format": 99}))
    with pytest.raises(LibraryError, match="another version"):
        SegmentStore.open(store.folder)


def test_two_do_not_write_at_once(store: SegmentStore) -> None:
    pytest.importorskip("fcntl")
    lock = store.locked
    with (
        lock(store.folder),
        pytest.raises(LibraryError, match="Another process"),
        lock(store.folder),
    ):
        pass
    with lock(store.folder):
        pass


def test_a_reader_follows_a_writer(store: SegmentStore) -> None:
    reader = SegmentStore.open(store.folder)
    store.commit([segment("d")], ["000001"])
    assert [e.id for part in reader.read_all() for e in part.entries] == ["c", "d"]
    (store.folder / "000002.json").unlink()
    with pytest.raises(LibraryError, match="damaged"):
        reader.read_all()


def test_only_the_maps_of_a_segment_keep_a_file_open(
    store: SegmentStore, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = store.read("000001")
    assert isinstance(read.cells, np.memmap)
    assert not isinstance(read.embeddings, np.memmap) and not isinstance(read.aspects, np.memmap)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(np, "load", full)
    with pytest.raises(LibraryError, match="ulimit") as told:
        store.read("000001")
    assert "delete" not in str(told.value)


def test_a_folder_of_other_files_is_left_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match=r"notes\.txt"), SegmentStore.locked(tmp_path):
        pass
    assert [path.name for path in tmp_path.iterdir()] == ["notes.txt"]
