from __future__ import annotations

import json
import os
import time
from functools import partial
from pathlib import Path
from random import Random

import pytest

from cadpose.errors import InputError
from tests.fuzzing import running
from tests.fuzzing.families import FAMILIES
from tests.fuzzing.mutations import mutated
from tests.fuzzing.running import Make, Target, fuzz


def made(action: str) -> Make:
    """A reader that goes wrong where a byte of its file is changed."""

    def read(path: Path) -> None:
        if path.read_bytes() == b"right":
            return
        if action == "refuse":
            raise InputError(f"{path} is damaged")
        if action == "raise":
            raise KeyError("colour")
        if action == "end":
            os.abort()
        if action == "hang":
            time.sleep(60)
        if action == "grow":
            bytearray(4 * 2**30)

    return lambda folder: [Target(folder / "a.bin", b"right", partial(read, folder / "a.bin"))]


def test_a_refusal_is_no_failure(tmp_path: Path) -> None:
    outcome = fuzz("made", made("refuse"), 40, kept=tmp_path)
    assert outcome.inputs == 40 and outcome.refused >= 35 and outcome.failures == []
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("action", "told"),
    [("raise", "KeyError"), ("end", "the process ended"), ("grow", "MemoryError"), ("hang", "more than")],
)
def test_what_goes_wrong_is_found_and_kept(
    action: str, told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(running, "SECONDS", 0.5)
    outcome = fuzz("made", made(action), 40, kept=tmp_path, most_failures=1)
    assert told in outcome.failures[0]
    kept = [path for path in tmp_path.iterdir() if path.suffix == ".bin"]
    assert len(kept) == 1 and kept[0].read_bytes() != b"right"


def test_the_same_numbers_give_the_same_files() -> None:
    data = json.dumps({"a": [1, 2, {"b": "text"}]}).encode()
    once = [mutated(data, [data], Random(f"0 {i}")) for i in range(200)]
    assert once == [mutated(data, [data], Random(f"0 {i}")) for i in range(200)]
    assert len(set(once)) > 120


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES)
def test_damaged_files_are_refused_in_a_sentence(family: str, tmp_path: Path) -> None:
    outcome = fuzz(family, FAMILIES[family], 1500, seed=1, kept=tmp_path)
    assert outcome.failures == []
    assert outcome.inputs == 1500 and outcome.refused > 300
    assert outcome.megabytes < running.MEGABYTES
