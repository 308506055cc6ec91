from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pytest

from cadpose.errors import InputError
from cadpose.evaluation.bench_compare import compare, read_baseline, slower, timings, unmatched


def run(gflops: float = 100.0, detect: float = 200.0) -> dict[str, Any]:
    return {
        "machine": {"gflops": gflops, "gflops_one_core": 50.0, "gbytes": 10.0},
        "stages": {"detect": detect, "library": 0.1},
        "rotation": {"whole": 50.0},
        "candidates": [
            {"name": "raster", "ms": 30.0},
            {"name": "blender", "ms": None, "skipped": "none"},
        ],
        "renderers": None,
        "galleries": {"per_minute": 12.0},
        "synth": {"drawing": 100.0, "writing": 50.0},
    }


def test_every_timing_in_milliseconds() -> None:
    assert timings(run()) == {
        "stages: detect": 200.0,
        "stages: library": 0.1,
        "rotation: whole": 50.0,
        "candidates: raster": 30.0,
        "galleries: a model": 5000.0,
        "synth: drawing a photo": 10.0,
        "synth: writing a photo": 20.0,
    }


def test_a_machine_of_half_the_speed_may_take_twice_as_long() -> None:
    before, after = run(), run(gflops=50.0, detect=400.0)
    changes = {change.name: change.ratio for change in compare(before, after)}
    assert changes["stages: detect"] == pytest.approx(1.0)
    assert changes["rotation: whole"] == pytest.approx(0.5)


def test_the_slowest_comes_first_and_what_one_run_lacks_is_left_out() -> None:
    after = run(detect=300.0)
    after["synth"] = None
    changes = compare(run(), after)
    assert changes[0].name == "stages: detect"
    assert changes[0].ratio == pytest.approx(1.5)
    assert not any(change.name.startswith("synth") for change in changes)
    assert unmatched(run(), after) == ["synth: drawing a photo", "synth: writing a photo"]


def test_a_short_stage_that_became_long_is_told() -> None:
    after = run()
    after["stages"]["library"] = 60.0
    (worse,) = slower(compare(run(), after), 0.25)
    assert (worse.name, worse.before, worse.after) == ("stages: library", 0.1, 60.0)


def test_the_work_of_one_core_is_scaled_by_one_core() -> None:
    changes = {change.name: change.ratio for change in compare(run(), run(gflops=400.0))}
    assert changes["galleries: a model"] == pytest.approx(1.0)
    assert changes["stages: detect"] == pytest.approx(4.0)


def test_a_run_is_read_back(tmp_path: Path) -> None:
    (tmp_path / "run.json").write_text(json.dumps(run()))
    assert read_baseline(tmp_path / "run.json") == run()


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"machine": {"gflops": 0}}',
        '{"machine": {"gflops": 5}, "stages": []}',
        "[" * 100_000,
        '{"machine": {"gflops": 5, "gflops_one_core": 5}, "stages": {"detect": 1' + "0" * 400 + "}}",
        '{"machine": {"gflops": 1' + "0" * 400 + ', "gflops_one_core": 5}, "stages": {"detect": 9}}',
    ],
)
def test_another_file_is_refused_by_name(tmp_path: Path, text: str) -> None:
    (tmp_path / "other.json").write_text(text)
    with pytest.raises(InputError, match=r"other\.json"):
        read_baseline(tmp_path / "other.json")


def test_a_missing_file_is_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.json"):
        read_baseline(tmp_path / "none.json")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match="no file"):
        read_baseline(tmp_path / "pipe")
