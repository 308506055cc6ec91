"""The acceptance test of many photos at a small size: scripts/kill_test.py on made-up photos and models."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from cadpose.library.catalogue import Library
from tests.conftest import REPOSITORY
from tests.small_library import save


@pytest.mark.slow
@pytest.mark.parametrize("writers", [1, 2])
def test_killed_runs_lose_and_repeat_nothing(small_library: Library, tmp_path: Path, writers: int) -> None:
    for number in range(3):
        save(tmp_path / "from" / f"{number}.png", np.full((96, 128, 3), 60 + 40 * number, np.uint8))
    command = [sys.executable, str(REPOSITORY / "scripts" / "kill_test.py"), str(tmp_path / "run")]
    command += ["--photos", "60", "--kills", "4", "--writers", str(writers)]
    command += ["--from", str(tmp_path / "from"), "--library", str(small_library.path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900, check=False)
    assert done.stdout, done.stderr
    told = json.loads(done.stdout)
    assert told["problems"] == [] and done.returncode == 0
    assert told["documents"] == 60 and told["written_again"] == 0 and len(told["kills"]) == 4
