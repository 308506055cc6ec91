"""The load script in small: several reviewers at once, and every decision there exactly once."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("uvicorn", reason="needs cadpose[review]")

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "review_load.py"


def test_no_decision_is_lost(tmp_path: Path) -> None:
    out = tmp_path / "load.json"
    command = [sys.executable, str(SCRIPT), str(out), "--clients", "8", "--requests", "250", "--items", "30"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    told = json.loads(out.read_text())
    assert told["errors"] == [] and told["faults_in_the_store"] == []
    assert told["requests"] >= 250 and told["decisions_taken"] > 10 and told["decisions_refused"] > 3
