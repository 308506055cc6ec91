from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx", reason="needs cadpose[train]")
pytest.importorskip("faiss", reason="needs cadpose[index]")
from cadpose.errors import InputError
from cadpose.evaluation.scale_experiment import BUILT, RESULTS, _built, run_scale, scale_plot
from cadpose.evaluation.scale_library import WarpedSource
from cadpose.library.catalogue import Library
from tests.similarity.index.made import network


def test_small_sources_are_part_of_larger_ones(small_library: Library) -> None:
    small, large = (WarpedSource(small_library, n) for n in (7, 13))
    assert len(large.entries()) == 13 and set(small.entries()) < set(large.entries())
    assert {e.category for e in large.entries()} == {"car", "chair"}


def test_copies_are_warped_the_same_each_time(small_library: Library) -> None:
    source, again = WarpedSource(small_library, 15), WarpedSource(small_library, 15)
    name = small_library.models()[0].id
    copies = {e.id: e for e in source.entries() if e.id.startswith(name)}
    first, second, third = (source.scene(copies[f"{name}#{k:04d}"]).vertices for k in range(3))
    assert np.abs(first - second).max() > 0.005 < np.abs(second - third).max()
    np.testing.assert_array_equal(again.scene(copies[f"{name}#0002"]).vertices, third)
    other = WarpedSource(small_library, 15, seed=1)
    assert not set(other.entries()) & set(source.entries())


def test_an_index_is_measured_as_it_grows(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from cadpose.similarity.index import build

    monkeypatch.setattr(build, "SEGMENT", 4)
    out, data = tmp_path / "out", network()
    (row,) = run_scale(out, small_library, [6], data, queries=2)
    assert row.models == 6 and row.megabytes > 0.1 and row.models_per_second > 0 and row.peak_rss_gb > 0.05
    assert row.filtered.recall == row.unfiltered.recall == 1.0 and row.unfiltered.found == 1.0
    with pytest.raises(InputError, match="--resume"):
        run_scale(out, small_library, [6], data, queries=2)
    with pytest.raises(InputError, match="seed"):
        run_scale(out, small_library, [6], data, queries=2, seed=1, resume=True)
    steps: list[int] = []
    rows = run_scale(
        out, small_library, [6, 11], data, queries=2, resume=True, progress=lambda done, _: steps.append(done)
    )
    assert rows[0] == row and rows[1].models == 11 and rows[1].megabytes > row.megabytes
    assert min(steps) == 6  # what was there is not drawn again
    assert sum(json.loads(line)["models"] for line in (out / BUILT).read_text().splitlines()) == 11
    assert [told["models"] for told in json.loads((out / RESULTS).read_text())] == [6, 11]
    assert scale_plot(rows).startswith(b"\x89PNG")
    with pytest.raises(InputError, match="holds 11 models already, more than 8"):
        run_scale(out, small_library, [8], data, queries=2, resume=True)
    assert (out / BUILT).read_text().count("\n") == 4  # the index is as it was


def test_a_killed_run_may_have_cut_the_last_line(tmp_path: Path) -> None:
    parts = [{"models": 4, "seconds": 1.0, "cpu": 2.0}, {"models": 2, "seconds": 0.5, "cpu": 1.0}]
    lines = [json.dumps(part) for part in parts]
    assert _built(tmp_path) == []
    (tmp_path / BUILT).write_text("\n".join([*lines, lines[0][:17]]))
    assert _built(tmp_path) == parts
    (tmp_path / BUILT).write_text("\n".join([lines[0][:17], *lines]))
    with pytest.raises(InputError, match="damaged in line 1"):
        _built(tmp_path)


def test_times_are_counted_up_to_the_size(small_library: Library, tmp_path: Path) -> None:
    data = network()
    run_scale(tmp_path, small_library, [3], data, queries=1)
    (tmp_path / RESULTS).unlink()
    told = {"models": 3, "seconds": 2.0, "cpu": 1.5}
    (tmp_path / BUILT).write_text(2 * (json.dumps(told) + "\n"))
    (row,) = run_scale(tmp_path, small_library, [3], data, queries=1, resume=True)
    assert row.build_seconds == 2.0 and row.cpu_ms_a_model == 500.0
    (tmp_path / RESULTS).unlink()
    (tmp_path / BUILT).unlink()
    with pytest.raises(InputError, match="does not tell how the index was built"):
        run_scale(tmp_path, small_library, [3], data, queries=1, resume=True)
