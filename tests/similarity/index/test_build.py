from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cadpose.errors import LibraryError
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.rendering.scene import Scene, build_scene
from cadpose.similarity.embedding import SIDE, ViewEmbedder
from cadpose.similarity.index import build
from cadpose.similarity.index.build import LibrarySource, build_index
from cadpose.similarity.index.describe import ViewDescriber, framing
from cadpose.similarity.index.grid import ViewGrid
from cadpose.similarity.index.segments import Entry, SegmentStore
from tests.conftest import REPOSITORY

GRID = ViewGrid(4, (10.0,))


class Changed(LibrarySource):
    """A library of which some models are left out, changed or damaged."""

    def __init__(
        self, library: Library, out: Sequence[str] = (), changed: Sequence[str] = (), bad: Sequence[str] = ()
    ) -> None:
        super().__init__(library)
        self.out, self.changed, self.bad, self.drawn = set(out), set(changed), set(bad), list[str]()

    def entries(self) -> list[Entry]:
        return [
            replace(e, sha256="new") if e.id in self.changed else e
            for e in super().entries()
            if e.id not in self.out
        ]

    def scene(self, entry: Entry) -> Scene:
        self.drawn.append(entry.id)
        if entry.id in self.bad:
            raise LibraryError(f"{entry.id} is damaged")
        return super().scene(entry)


@pytest.fixture
def describer(embedder: ViewEmbedder) -> ViewDescriber:
    return ViewDescriber(embedder, GRID)


def content(folder: Path) -> dict[Entry, bytes]:
    """Everything that is kept of each model."""
    store = SegmentStore.open(folder)
    found: dict[Entry, bytes] = {}
    for segment in map(store.read, store.names):
        for i, entry in enumerate(segment.entries):
            assert entry not in found
            parts = (segment.embeddings[i], segment.cells[i], segment.aspects[i])
            found[entry] = b"".join(part.tobytes() for part in parts)
    return found


def test_only_what_changed_is_drawn(
    small_library: Library, describer: ViewDescriber, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "SEGMENT", 2)
    cars = [m.id for m in small_library.models("car")]
    source = Changed(small_library, out=cars[:1])
    report = build_index(tmp_path, source, describer, workers=2)
    assert len(report.added) == report.models == 4 and not report.failed and not report.removed
    assert report.nbytes == sum(p.stat().st_size for p in tmp_path.iterdir())
    before = content(tmp_path)

    source = Changed(small_library, out=cars[1:2], changed=cars[2:3])
    report = build_index(tmp_path, source, describer)
    assert sorted(source.drawn) == sorted([cars[0], cars[2]]) == list(report.added)
    assert report.removed == (cars[1],) and report.unchanged == 2 and report.models == 4
    after = content(tmp_path)
    assert {e.id for e in after} == {m.id for m in small_library.models()} - {cars[1]}
    assert all(after[e] == before[e] for e in after if e in before)

    source = Changed(small_library, out=cars[1:2], changed=cars[2:3])
    assert build_index(tmp_path, source, describer).added == () and source.drawn == []


def test_one_category_leaves_the_others(
    small_library: Library, describer: ViewDescriber, tmp_path: Path
) -> None:
    build_index(tmp_path, LibrarySource(small_library), describer, categories=["car"])
    assert {e.category for e in content(tmp_path)} == {"car"}
    report = build_index(tmp_path, LibrarySource(small_library), describer, categories=["chair"])
    assert len(report.added) == 2 and report.models == 5 and not report.removed


def test_a_damaged_model_is_reported_and_tried_again(
    small_library: Library, describer: ViewDescriber, tmp_path: Path
) -> None:
    bad = small_library.models("car")[0].id
    report = build_index(tmp_path, Changed(small_library, bad=[bad]), describer)
    assert report.failed == ((bad, f"{bad} is damaged"),) and report.models == 4
    report = build_index(tmp_path, Changed(small_library), describer)
    assert report.added == (bad,) and report.models == 5


def test_another_grid_or_network_is_refused(
    small_library: Library, describer: ViewDescriber, tmp_path: Path
) -> None:
    build_index(tmp_path, LibrarySource(small_library), describer, categories=["chair"])
    other = ViewDescriber(describer.embedder, ViewGrid(3, (10.0,)))
    with pytest.raises(LibraryError, match=r"other settings \(azimuths\)"):
        build_index(tmp_path, LibrarySource(small_library), other)


def test_nothing_is_made_while_another_process_makes_it(
    small_library: Library, describer: ViewDescriber, tmp_path: Path
) -> None:
    pytest.importorskip("fcntl")
    with SegmentStore.locked(tmp_path / "new"), pytest.raises(LibraryError, match="Another process"):
        build_index(tmp_path / "new", LibrarySource(small_library), describer)
    assert not (tmp_path / "new" / "index.json").exists()


def test_small_segments_are_joined(
    small_library: Library, describer: ViewDescriber, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(build, "_SMALL_SEGMENTS", 3)
    for model in small_library.models():
        left = [m.id for m in small_library.models() if m.id > model.id]
        build_index(tmp_path, Changed(small_library, out=left), describer)
    assert len(SegmentStore.open(tmp_path).names) <= 3
    assert len(content(tmp_path)) == 5


KILLED = """
import sys, time
from pathlib import Path
from cadpose.library.catalogue import Library
from cadpose.similarity.embedding import ViewEmbedder
from cadpose.similarity.index import build
from cadpose.similarity.index.describe import ViewDescriber
from cadpose.similarity.index.grid import ViewGrid
from tests.similarity.index.made import network
build.SEGMENT = 1
def committed(models):
    print("committed", flush=True)
    time.sleep(0.2 if sys.argv[3] == "soon" else 60)
describer = ViewDescriber(ViewEmbedder(network(), threads=1), ViewGrid(4, (10.0,)))
source = build.LibrarySource(Library.open(Path(sys.argv[2])))
build.build_index(Path(sys.argv[1]), source, describer, committed=committed)
"""


@pytest.mark.parametrize("when", ["soon", "between"])
def test_a_killed_run_goes_on_to_the_same_index(
    small_library: Library, describer: ViewDescriber, tmp_path: Path, when: str
) -> None:
    killed, whole = tmp_path / "killed", tmp_path / "whole"
    with subprocess.Popen(
        [sys.executable, "-c", KILLED, str(killed), str(small_library.path), when],
        stdout=subprocess.PIPE, cwd=REPOSITORY,
    ) as run:  # fmt: skip
        assert run.stdout is not None
        assert run.stdout.readline() == b"committed\n"
        if when == "soon":
            run.stdout.readline()  # and in the middle of the third
        run.send_signal(signal.SIGKILL)
        assert run.wait() == -signal.SIGKILL
    there = content(killed)
    assert 1 <= len(there) < 5
    source = Changed(small_library)
    report = build_index(killed, source, describer)
    assert report.unchanged == len(there) and len(source.drawn) == 5 - len(there)
    build_index(whole, LibrarySource(small_library), describer)
    assert content(killed) == content(whole)


def test_scenes_are_framed_as_meshes_are(small_library: Library) -> None:
    mesh = small_library.mesh(small_library.models("car")[0])
    ours, theirs = (
        framing(build_scene(mesh), GRID.rotations, SIDE),
        Cameras.framing(GRID.rotations, mesh.hull, size=SIDE),
    )
    np.testing.assert_allclose(ours.focal_px, theirs.focal_px, rtol=1e-5)
    np.testing.assert_allclose(ours.principal_px, theirs.principal_px, atol=1e-3)
