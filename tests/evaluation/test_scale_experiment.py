from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx", reason="needs cadpose[train]")
pytest.importorskip("faiss", reason="needs cadpose[index]")
from cadpose.errors import InputError
from cadpose.evaluation.scale_experiment import BUILT, RESULTS, run_scale, scale_plot
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
