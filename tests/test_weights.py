from __future__ import annotations

import hashlib
import http.server
import tempfile
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

from cadpose import weights
from cadpose.errors import DependencyError
from cadpose.weights import (
    REGISTRY,
    UNPUBLISHED,
    Unpublished,
    Weights,
    cache_folder,
    ensure,
    is_intact,
    location,
    placed,
)

DATA = bytes(range(256)) * 5000


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache" / "weights"


@pytest.fixture
def server(tmp_path: Path) -> Iterator[str]:
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def log_message(self, format: str, *args: object) -> None:
            pass

    (tmp_path / "www").mkdir()
    (tmp_path / "www" / "net.onnx").write_bytes(DATA)
    made = http.server.ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path / "www")))
    threading.Thread(target=made.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{made.server_port}"
    made.shutdown()
    made.server_close()


def register(monkeypatch: pytest.MonkeyPatch, url: str, **changes: object) -> Weights:
    told: dict[str, object] = {
        "name": "net",
        "file": "net.onnx",
        "sha256": hashlib.sha256(DATA).hexdigest(),
        "size": len(DATA),
        "licence": "CC0-1.0",
        "url": url,
    }
    made = Weights(**(told | changes))  # type: ignore[arg-type]
    monkeypatch.setitem(REGISTRY, made.name, made)
    return made


def test_the_registrys_packaged_weights_are_there_and_intact() -> None:
    packaged = {name: entry for name, entry in REGISTRY.items() if entry.package}
    assert {"lite0-trunk", "rotation"} <= set(packaged)
    for name, entry in packaged.items():
        path = ensure(name)
        assert path.stat().st_size == entry.size and is_intact(entry, path)


def test_vgg16_comes_from_where_its_name_says() -> None:
    entry = REGISTRY["vgg16-imagenet"]
    assert not entry.package
    assert entry.url.startswith("https://download.pytorch.org/") and entry.url.endswith("/" + entry.file)
    # PyTorch's file names end in the first digits of the SHA-256.
    assert Path(entry.file).stem.rpartition("-")[2] == entry.sha256[:8]


def test_the_ssd_is_never_part_of_this_project() -> None:
    assert REGISTRY["ssd-mobilenet-v2-coco"].package != "cadpose"


def test_fetched_once_then_from_the_cache(monkeypatch: pytest.MonkeyPatch, server: str, cache: Path) -> None:
    entry = register(monkeypatch, f"{server}/net.onnx")
    assert location(entry) is None
    path = ensure("net")
    assert path == cache / "net.onnx" and path.read_bytes() == DATA
    monkeypatch.setattr(weights, "_download", None)  # a second fetch would fail
    assert ensure("net") == path == location(entry)


def test_put_there_by_hand(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    register(monkeypatch, "http://127.0.0.1:9/net.onnx")
    cache.mkdir(parents=True)
    (cache / "net.onnx").write_bytes(DATA)
    assert ensure("net") == cache / "net.onnx"


def test_offline_names_the_address_and_the_place(monkeypatch: pytest.MonkeyPatch, cache: Path) -> None:
    register(monkeypatch, "http://127.0.0.1:9/net.onnx")
    with pytest.raises(DependencyError) as caught:
        ensure("net")
    message = str(caught.value)
    assert "http://127.0.0.1:9/net.onnx" in message and str(cache / "net.onnx") in message
    assert "\n" not in message and list(cache.iterdir()) == []


@pytest.mark.parametrize(
    "sent",
    [DATA[:-1] + b"!", DATA[: len(DATA) // 2], DATA + b"more", b""],
    ids=["other", "short", "long", "none"],
)
def test_what_is_not_the_file_leaves_nothing(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, cache: Path, sent: bytes
) -> None:
    (tmp_path / "sent").write_bytes(sent)
    register(monkeypatch, (tmp_path / "sent").as_uri())
    with pytest.raises(DependencyError, match="SHA-256 or length"):
        ensure("net")
    assert list(cache.iterdir()) == []


def test_a_missing_page_and_odd_addresses(monkeypatch: pytest.MonkeyPatch, server: str) -> None:
    register(monkeypatch, f"{server}/none.onnx")
    with pytest.raises(DependencyError, match=r"404"):
        ensure("net")
    register(monkeypatch, "ftp://127.0.0.1/net.onnx")
    with pytest.raises(DependencyError, match="not fetched"):
        ensure("net")


def test_a_damaged_cache_is_fetched_again(monkeypatch: pytest.MonkeyPatch, server: str, cache: Path) -> None:
    register(monkeypatch, f"{server}/net.onnx")
    cache.mkdir(parents=True)
    (cache / "net.onnx").write_bytes(DATA[::-1])
    assert ensure("net").read_bytes() == DATA


def test_missing_and_damaged_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    register(monkeypatch, "", package="no_such_package_here", requirement="no-such")
    with pytest.raises(DependencyError, match="pip install no-such"):
        ensure("net")
    register(monkeypatch, "", package="cadpose", file="py.typed", requirement="cadpose")
    with pytest.raises(DependencyError, match="SHA-256 differs"):
        ensure("net")


def test_malformed_entries() -> None:
    with pytest.raises(ValueError, match="neither"):
        Weights(name="x", file="x", sha256="0" * 64, size=1, licence="?")
    with pytest.raises(ValueError, match="malformed"):
        Weights(name="x", file="x", sha256="0", size=1, licence="?", url="https://example.org/x")


def test_cache_folder_without_the_variable(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CADPOSE_CACHE")
    assert cache_folder().name == "cadpose"


def test_unpublished_weights_are_never_fetched(cache: Path) -> None:
    assert {"delf", "delf-v1"} <= set(UNPUBLISHED)
    for name, entry in UNPUBLISHED.items():
        assert name == entry.name and entry.url.startswith("https://")
        with pytest.raises(DependencyError) as caught:
            placed(entry)
        message = str(caught.value)
        assert entry.url in message and str(cache / entry.file) in message and "\n" not in message


def test_unpublished_weights_must_not_change(cache: Path, caplog: pytest.LogCaptureFixture) -> None:
    entry = Unpublished("net", "net.pth", "https://example.org/net.pth", "unknown")
    cache.mkdir(parents=True)
    (cache / "net.pth").write_bytes(DATA)
    record = cache / "net.pth.sha256"
    assert placed(entry) == cache / "net.pth"
    assert record.read_text().split() == [hashlib.sha256(DATA).hexdigest(), "net.pth"]
    assert "first time" in caplog.text
    assert placed(entry) == cache / "net.pth"
    (cache / "net.pth").write_bytes(DATA[:-1])
    with pytest.raises(DependencyError, match=r"changed since its first use .* https://example\.org"):
        placed(entry)
    record.write_bytes(b"\xff")
    with pytest.raises(DependencyError, match=r"net\.pth\.sha256 cannot be read"):
        placed(entry)
    record.write_text("")
    with pytest.raises(DependencyError, match=r"net\.pth\.sha256 cannot be read"):
        placed(entry)
    record.unlink()
    assert placed(entry) == cache / "net.pth"
    assert sorted(p.name for p in cache.iterdir()) == ["net.pth", "net.pth.sha256"]
    # Others who share the cache can read it.
    assert record.stat().st_mode & 0o777 == 0o644


def test_a_published_md5_is_checked(cache: Path) -> None:
    cache.mkdir(parents=True)
    (cache / "net.pth").write_bytes(DATA)
    right = hashlib.md5(DATA).hexdigest()
    assert placed(Unpublished("net", "net.pth", "https://example.org", "unknown", right)).is_file()
    with pytest.raises(DependencyError, match="MD5 differs"):
        placed(Unpublished("net", "net.pth", "https://example.org", "unknown", "0" * 32))


def test_the_published_start_of_a_sha256_is_checked(cache: Path) -> None:
    cache.mkdir(parents=True)
    (cache / "net.pth").write_bytes(DATA)
    right = hashlib.sha256(DATA).hexdigest()[:8]
    entry = Unpublished("net", "net.pth", "https://example.org", "unknown", sha256_start=right)
    assert placed(entry).is_file()
    (cache / "net.pth").write_bytes(DATA + DATA)
    with pytest.raises(DependencyError, match=f"SHA-256 does not begin with {right}"):
        placed(entry)
    # The start holds on first use too, and the name that OpenMMLab gave tells it.
    named = UNPUBLISHED["detectors-htc-r50"]
    assert named.file.endswith(f"-{named.sha256_start}.pth") and named.url.endswith(named.file)
    (cache / named.file).write_bytes(DATA)
    with pytest.raises(DependencyError, match="does not begin with 329b1453"):
        placed(named)


def test_a_folder_that_cannot_be_written_is_no_obstacle(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    cache.mkdir(parents=True)
    (cache / "net.pth").write_bytes(DATA)

    def refuse(*args: object, **kwargs: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(tempfile, "NamedTemporaryFile", refuse)
    assert placed(Unpublished("net", "net.pth", "https://example.org", "unknown")).is_file()
    assert "cannot be written" in caplog.text
