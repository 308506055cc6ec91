"""The container file: what it says, and, by `make container`, what comes of it."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]
TEXT = (REPOSITORY / "Containerfile").read_text(encoding="utf-8")


@pytest.fixture
def script(monkeypatch: pytest.MonkeyPatch) -> Any:
    """scripts/try_container.py as a module."""
    monkeypatch.syspath_prepend(str(REPOSITORY / "scripts"))
    return importlib.import_module("try_container")


def test_the_base_has_a_version_and_the_entry_point_no_rights(script: Any) -> None:
    steps = script.instructions(TEXT)
    assert steps[0][0] == "FROM" and re.fullmatch(r"debian:\d+\.\d+-slim", steps[0][1])
    names = [name for name, _ in steps]
    users = [rest for name, rest in steps if name == "USER"]
    assert users == ["cadpose"] and names.index("USER") < names.index("ENTRYPOINT")
    settings = " ".join(rest for name, rest in steps if name == "ENV")
    assert "CADPOSE_LIBRARY=/library" in settings and "NUMBA_CACHE_DIR=/cache" in settings
    (volumes,) = (rest for name, rest in steps if name == "VOLUME")
    assert all(place in volumes for place in ("/library", "/cache", "/data/out"))


def test_nothing_but_the_wheel_is_sent_to_the_build() -> None:
    lines = (REPOSITORY / ".dockerignore").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if not line.startswith("#")] == ["*", "!dist/*.whl"]
    assert not re.search(r"^(COPY|ADD)\b", TEXT, re.MULTILINE)
    assert re.findall(r"source=(\S+?),", TEXT) == ["dist"]


def test_instructions_are_read_as_an_engine_reads_them(script: Any) -> None:
    text = "FROM debian:1.2-slim\n# no\nRUN a \\\n  # neither\n && b\nenv X=1 \\\n    Y=2\n"
    assert script.instructions(text) == [
        ("FROM", "debian:1.2-slim"),
        ("RUN", "a   && b"),
        ("ENV", "X=1      Y=2"),
    ]
    with pytest.raises(SystemExit, match="knows no HEALTHCHECK"):
        script.instructions("FROM debian:1.2-slim\nHEALTHCHECK NONE\n")


@pytest.mark.slow
@pytest.mark.skipif(
    "CADPOSE_CONTAINER" not in os.environ, reason="minutes, and root: `make container` runs it"
)
def test_the_image_annotates_a_photo(tmp_path: Path) -> None:
    skimage = pytest.importorskip("skimage", reason="the demo's photos: pip install 'cadpose[demo]'")
    photo = Path(skimage.__file__).parent / "data" / "coffee.png"
    if not photo.is_file():
        subprocess.run(
            [sys.executable, str(REPOSITORY / "scripts" / "demo_photos.py"), str(tmp_path)], check=True
        )
        photo = tmp_path / "coffee.png"
    script = REPOSITORY / "scripts" / "try_container.py"
    run = subprocess.run(
        [sys.executable, str(script), "--photo", str(photo), "--work", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=3000,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    assert re.search(r"coffee\.png: [1-9]\d* objects", run.stdout)
