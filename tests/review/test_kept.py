"""What is kept stays within its bytes, and is made once."""

from __future__ import annotations

import os
import threading
import time
from pathlib import Path

from cadpose.review import kept
from cadpose.review.kept import Kept, KeptPictures


def test_the_least_used_goes() -> None:
    held: Kept[bytes] = Kept(10, len)
    for key in "abc":
        held.put(key, b"1234")
        held.get("a")
    assert held.get("a") == b"1234" and held.get("b") is None and held.get("c") == b"1234"
    held.put("large", b"x" * 100)
    assert held.get("large") is not None and held.get("a") is None
    held.put("large", b"y")
    held.put("d", b"1234")
    assert held.get("large") == b"y"


def test_each_is_made_once_by_one_thread() -> None:
    held: Kept[bytes] = Kept(100, len)
    made: list[str] = []

    def make() -> bytes:
        made.append("x")
        time.sleep(0.05)
        return b"x"

    threads = [threading.Thread(target=held.made, args=("key", make)) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert made == ["x"] and held.made("key", make) == b"x" and not held._making


def test_what_fails_is_tried_again() -> None:
    held: Kept[bytes] = Kept(100, len)
    for _ in range(2):
        try:
            held.made("key", lambda: bytes([1 // 0]))
        except ZeroDivisionError:
            continue
        raise AssertionError("it did not fail")
    assert held.made("key", lambda: b"x") == b"x"


def test_on_disk_between_starts(tmp_path: Path) -> None:
    assert KeptPictures(100, tmp_path).made("key", lambda: b"picture") == b"picture"
    assert KeptPictures(100, tmp_path).made("key", lambda: b"another") == b"picture"
    assert KeptPictures(100).made("key", lambda: b"another") == b"another"


def test_a_disk_that_cannot_be_written_is_no_fault(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_bytes(b"")
    assert KeptPictures(100, file / "folder").made("key", lambda: b"x") == b"x"


def test_the_oldest_files_go(tmp_path: Path) -> None:
    for number in range(5):
        path = tmp_path / "00" / f"{number}.bin"
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(b"x" * 10)
        os.utime(path, (number, number))
    kept._tidy(tmp_path, 25)
    assert sorted(p.name for p in tmp_path.glob("*/*")) == ["3.bin", "4.bin"]
