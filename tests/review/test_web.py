"""The page's sources: types, unit tests, and that the committed bundle is what they build.

`make web-packages` fetches what they need.
"""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

WEB = Path(__file__).parents[2] / "web"
STATIC = WEB.parent / "src" / "cadpose" / "review" / "static"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("npm") is None or not (WEB / "node_modules").is_dir(),
        reason="needs node and the page's packages: run `make web-packages`",
    ),
]


def run(*words: str) -> None:
    done = subprocess.run(words, cwd=WEB, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_types_fit() -> None:
    run("npm", "run", "check")


def test_its_own_tests_pass() -> None:
    run("npm", "test")


def test_the_committed_page_is_what_the_sources_build(tmp_path: Path) -> None:
    run("npx", "vite", "build", "--outDir", str(tmp_path), "--logLevel", "warn")
    widget = ("--config", "vite.widget.config.ts")
    run("npx", "vite", "build", *widget, "--outDir", str(tmp_path), "--logLevel", "warn")
    built = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    kept = {path.name: path.read_bytes() for path in STATIC.iterdir()}
    assert built.keys() == kept.keys(), "run `make web` and commit what it builds"
    changed = [name for name, data in built.items() if kept[name] != data]
    assert changed == [], "run `make web` and commit what it builds"
