"""The files that people install: what they hold, and that they work without extras."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import pytest
import yaml

import cadpose
from cadpose.weights import REGISTRY

REPOSITORY = Path(__file__).resolve().parents[2]
PACKAGE = REPOSITORY / "src" / "cadpose"
INFO = "cadpose-0.0.dist-info"
THIS_PYTHON = f"{sys.version_info[0]}.{sys.version_info[1]}"


def look(*archives: Path) -> subprocess.CompletedProcess[str]:
    """What the script says of archives."""
    script = REPOSITORY / "scripts" / "wheel_contents.py"
    return subprocess.run(
        [sys.executable, str(script), *map(str, archives)], capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def members() -> dict[str, bytes]:
    """What a wheel of this checkout would hold."""
    weights = {w.file for w in REGISTRY.values() if w.package == "cadpose"}
    tracked = [
        path
        for folder in ("annotations/migrations", "review/static", "data")
        for path in (PACKAGE / folder).rglob("*")
        if path.is_file() and path.suffix != ".pyc"
    ]
    held = {f"cadpose/{path.relative_to(PACKAGE).as_posix()}": path.read_bytes() for path in tracked}
    assert {f"cadpose/{name}" for name in weights} <= held.keys()
    held["cadpose/py.typed"] = b""
    for name in ("METADATA", "RECORD", "WHEEL", "entry_points.txt", "licenses/LICENSE", "licenses/NOTICE"):
        held[f"{INFO}/{name}"] = b""
    return held


def write(path: Path, members: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return path


def test_a_wheel_of_this_checkout_is_in_order(members: dict[str, bytes], tmp_path: Path) -> None:
    found = look(write(tmp_path / "cadpose-0.0-py3-none-any.whl", members))
    assert (found.returncode, found.stderr) == (0, "")
    assert re.fullmatch(r"cadpose-0\.0-py3-none-any\.whl: [0-9.]+ MB, in order\n", found.stdout)


def _add(name: str, content: bytes = b"") -> Callable[[dict[str, bytes]], object]:
    return lambda members: members.update({name: content})


def _drop(name: str) -> Callable[[dict[str, bytes]], object]:
    return lambda members: members.pop(name)


@pytest.mark.parametrize(
    ("spoil", "fault"),
    [
        (_drop("cadpose/py.typed"), "lacks cadpose/py.typed"),
        (_drop("cadpose/review/static/three.js"), "lacks cadpose/review/static/three.js"),
        (_drop("cadpose/data/network-schema.json"), "lacks cadpose/data/network-schema.json"),
        (_drop("cadpose/annotations/migrations/versions/0002_history.py"), "0002_history.py"),
        (_drop(f"{INFO}/licenses/NOTICE"), "licenses/NOTICE"),
        (_drop("cadpose/data/weights/masks.onnx"), "lacks the network masks"),
        (_add("cadpose/data/weights/masks.onnx", b"other"), "lacks the network masks, or holds another"),
        (_add("cadpose/tests/test_a.py"), "holds cadpose/tests/test_a.py"),
        (_add("tests/test_a.py"), "holds tests beside the package"),
        (_add("cadpose/photo.JPG"), "holds cadpose/photo.JPG"),
        (_add("cadpose/__pycache__/a.cpython-311.pyc"), "holds cadpose/__pycache__"),
        (_add("cadpose/../../etc/passwd"), "holds cadpose/../../etc/passwd"),
        (_add("cadpose/data/large.bin", bytes(50_000_000)), "more than 48"),
    ],
)
def test_each_fault_is_found(
    spoil: Callable[[dict[str, bytes]], object], fault: str, members: dict[str, bytes], tmp_path: Path
) -> None:
    spoilt = dict(members)
    spoil(spoilt)
    found = look(write(tmp_path / "cadpose-0.0-py3-none-any.whl", spoilt))
    assert found.returncode == 1, found.stdout
    assert fault in found.stdout


def test_the_version_stands_in_one_place() -> None:
    project = tomllib.loads((REPOSITORY / "pyproject.toml").read_text(encoding="utf-8"))
    assert "version" in project["project"]["dynamic"] and "version" not in project["project"]
    assert project["tool"]["hatch"]["version"]["path"] == "src/cadpose/__init__.py"
    assert version("cadpose") == cadpose.__version__


def test_the_citation_names_this_version_and_the_paper() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == cadpose.__version__
    (paper,) = citation["references"]
    assert paper["doi"] == "10.3390/app13020693"
    assert [author["family-names"] for author in paper["authors"]] == ["Park", "Son", "Jeong", "Park"]
    assert (paper["volume"], paper["start"], paper["year"]) == ("13", "693", 2023)


def test_the_changelog_begins_with_what_is_not_released_or_with_this_version() -> None:
    text = (REPOSITORY / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## \[([^\]]+)\]", text, re.MULTILINE)
    assert headings[0] in {"Unreleased", cadpose.__version__}


@pytest.mark.slow
@pytest.mark.skipif(
    THIS_PYTHON in os.environ.get("CADPOSE_WHEEL_TRIED", "").split(),
    reason="`make wheel` has tried it with this Python in this run",
)
def test_wheel_and_source_distribution_install_and_run(tmp_path: Path) -> None:
    """The whole of `make wheel` for this Python; the other Pythons are tried by that."""
    run = subprocess.run(
        [
            sys.executable,
            str(REPOSITORY / "scripts" / "check_wheel.py"),
            *("--out", str(tmp_path / "dist"), "--no-resolve"),
            *("--python", THIS_PYTHON, "--tried", str(tmp_path / "tried")),
        ],
        capture_output=True,
        text=True,
        timeout=1500,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert "the same bytes" in run.stdout
    assert "refusals named their extra" in run.stdout
    assert len(list((tmp_path / "dist").iterdir())) == 2
    assert (tmp_path / "tried").read_text(encoding="ascii").split() == [THIS_PYTHON]
