from __future__ import annotations

import gzip
import io
import tarfile
from pathlib import Path
from typing import Any

import pytest

from cadpose.errors import InputError
from cadpose.similarity.delf import archive
from cadpose.similarity.delf.archive import read_files

PATTERN = r"pca/mean\.datum|model/\w+"


def packed(path: Path, members: list[tuple[str, bytes]]) -> Path:
    with tarfile.open(path, "w:gz") as made:
        for name, data in members:
            member = tarfile.TarInfo(name)
            member.size = len(data)
            made.addfile(member, io.BytesIO(data))
    return path


def sparse(path: Path, headers: dict[str, str], name: str = "model/graph") -> Path:
    """An archive of one member that PAX headers call sparse."""
    with tarfile.open(path, "w:gz", format=tarfile.PAX_FORMAT) as made:
        member = tarfile.TarInfo(name)
        member.pax_headers = headers
        made.addfile(member)
    return path


def test_chosen_files_of_an_archive_and_of_its_folder(tmp_path: Path) -> None:
    members = [
        ("delf/model/graph", b"a" * 3000),
        ("delf/model/other.txt", b"b"),
        ("delf/pca/mean.datum", b"c"),
    ]
    made = packed(tmp_path / "delf.tar.gz", members)
    right = {"model/graph": b"a" * 3000, "pca/mean.datum": b"c"}
    assert read_files(made, PATTERN, 4000) == right
    with tarfile.open(made) as opened:
        # Debian 12's Python is older than the filter.
        safely: Any = {"filter": "data"} if hasattr(tarfile, "data_filter") else {}
        opened.extractall(tmp_path / "folder", **safely)
    assert read_files(tmp_path / "folder", PATTERN, 4000) == right
    assert read_files(tmp_path / "folder" / "delf", PATTERN, 4000) == right


def test_nothing_is_written_wherever_a_path_leads(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    paths = ["../../pca/mean.datum", "/model/graph", "model/../../up"]
    made = packed(tmp_path / "in" / "delf.tar.gz", [(name, b"x") for name in paths])
    assert set(read_files(made, PATTERN, 10)) == {"pca/mean.datum", "model/graph"}
    assert [p.name for p in tmp_path.rglob("*")] == ["in", "delf.tar.gz"]


def test_links_and_devices_are_not_followed(tmp_path: Path) -> None:
    (tmp_path / "secret").write_bytes(b"secret")
    path = tmp_path / "delf.tar.gz"
    with tarfile.open(path, "w:gz") as made:
        for name, kind in (("pca/mean.datum", tarfile.SYMTYPE), ("model/hard", tarfile.LNKTYPE)):
            member = tarfile.TarInfo(name)
            member.type, member.linkname = kind, str(tmp_path / "secret")
            made.addfile(member)
        device = tarfile.TarInfo("model/device")
        device.type = tarfile.CHRTYPE
        made.addfile(device)
    assert read_files(path, PATTERN, 10) == {}


def test_sizes_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = packed(tmp_path / "delf.tar.gz", [("bomb", bytes(3 * 2**20)), ("model/graph", bytes(3 * 2**20))])
    assert made.stat().st_size < 20_000
    with pytest.raises(InputError, match=r"model/graph has more than 2 MiB"):
        read_files(made, PATTERN, 2**21)
    monkeypatch.setattr(archive, "MAX_UNPACKED", 2**21)
    with pytest.raises(InputError, match="unpacks to more than 2 MiB"):
        read_files(made, PATTERN, 2**30)
    monkeypatch.setattr(archive, "MAX_PACKED", 1000)
    with pytest.raises(InputError, match="larger than"):
        read_files(made, PATTERN, 2**30)
    monkeypatch.setattr(archive, "MAX_MEMBERS", 1)
    (tmp_path / "more").write_bytes(b"")
    with pytest.raises(InputError, match="more than 1 files"):
        read_files(tmp_path, PATTERN, 2**30)


def test_all_files_together_are_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "model").mkdir()
    for i in range(3):
        (tmp_path / "model" / f"part_{i}").write_bytes(bytes(2**20))
    (tmp_path / "other").write_bytes(bytes(2**22))
    monkeypatch.setattr(archive, "MAX_UNPACKED", 3 * 2**20)
    assert len(read_files(tmp_path, PATTERN, 2**20)) == 3
    monkeypatch.setattr(archive, "MAX_UNPACKED", 2 * 2**20)
    with pytest.raises(InputError, match="unpacks to more than 2 MiB"):
        read_files(tmp_path, PATTERN, 2**20)


def test_sparse_files_are_refused(tmp_path: Path) -> None:
    """A few bytes that stand for 200 MiB of holes."""
    headers = {"GNU.sparse.map": "0,0", "GNU.sparse.size": str(200 * 2**20)}
    made = sparse(tmp_path / "delf.tar.gz", headers)
    assert made.stat().st_size < 400
    with pytest.raises(InputError, match="model/graph is a sparse file"):
        read_files(made, PATTERN, 2**30)
    # Those that nobody asks for are no matter.
    assert read_files(sparse(tmp_path / "other.tar.gz", headers, "other"), PATTERN, 2**30) == {}


def test_a_malformed_header_is_told_of_in_a_sentence(tmp_path: Path) -> None:
    made = sparse(tmp_path / "delf.tar.gz", {"GNU.sparse.map": "0,x"})
    with pytest.raises(InputError, match=r"delf\.tar\.gz: is no \.tar\.gz archive, or damaged"):
        read_files(made, PATTERN, 2**30)


def test_a_count_of_members_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(archive, "MAX_MEMBERS", 3)
    made = packed(tmp_path / "delf.tar.gz", [(f"{i}", b"") for i in range(4)])
    with pytest.raises(InputError, match="more than 3 files"):
        read_files(made, PATTERN, 10)


def test_two_files_of_one_name_are_refused(tmp_path: Path) -> None:
    made = packed(tmp_path / "delf.tar.gz", [("a/model/graph", b"1"), ("b/model/graph", b"2")])
    with pytest.raises(InputError, match="model/graph twice"):
        read_files(made, PATTERN, 10)


def test_damaged_archives_are_told_of_in_a_sentence(tmp_path: Path) -> None:
    made = packed(tmp_path / "delf.tar.gz", [("model/graph", bytes(range(256)) * 400)])
    whole = made.read_bytes()
    plain = gzip.decompress(whole)
    damaged = [
        b"",
        b"no archive",
        whole[: len(whole) // 2],
        whole[:100] + bytes(60) + whole[160:],
        gzip.compress(b"no tar, but long enough for one" * 40),
        gzip.compress(plain[:5000]),
    ]
    for i, data in enumerate(damaged):
        made.write_bytes(data)
        with pytest.raises(InputError) as caught:
            read_files(made, PATTERN, 2**20)
        assert str(made) in str(caught.value) and "\n" not in str(caught.value), i
    with pytest.raises(InputError, match="No such file"):
        read_files(tmp_path / "none", PATTERN, 10)
