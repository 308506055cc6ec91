"""The run over a local Ray cluster of two nodes: a photo that fails, one that kills its actor, a resume."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from cadpose.annotations.store import Store
from cadpose.batch.outcome import PhotoOutcome
from cadpose.batch.run import RunOptions, annotate_job
from cadpose.errors import DependencyError, LibraryError
from cadpose.library.catalogue import Library
from tests.batch.fakes import FakeJob, picture

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def cluster() -> Iterator[None]:
    """Two nodes of one CPU each on this machine."""
    # Read when Ray is imported: no telemetry, no dashboard, no talk.
    os.environ |= {
        "RAY_USAGE_STATS_ENABLED": "0",
        "RAY_DEDUP_LOGS": "0",
        "RAY_DATA_DISABLE_PROGRESS_BARS": "1",
    }
    ray = pytest.importorskip("ray", reason="needs Ray: `make ray`")
    pytest.importorskip("ray.data", reason="needs Ray Data: `make ray`")
    from ray.cluster_utils import Cluster

    head = {"num_cpus": 1, "include_dashboard": False, "object_store_memory": 400 * 2**20}
    nodes = Cluster(initialize_head=True, head_node_args=head)
    try:
        nodes.add_node(num_cpus=1, object_store_memory=400 * 2**20)
        environment = {
            name: value for name, value in os.environ.items() if name.startswith("CADPOSE_") and value
        }
        ray.init(
            address=nodes.address,
            log_to_driver=False,
            logging_level="ERROR",
            runtime_env={"env_vars": environment},
        )
        yield
    finally:
        ray.shutdown()
        nodes.shutdown()


def run(job: FakeJob, photos: list[Path], out: Path, options: RunOptions) -> dict[str, PhotoOutcome]:
    told = list(annotate_job(job, photos, out, options, workers=2, photo_timeout=60.0, executor="ray"))
    assert len(told) == len(photos)
    return {outcome.photo.name: outcome for outcome in told}


@pytest.mark.usefixtures("cluster")
def test_two_nodes_annotate_and_lose_nothing(small_library: Library, tmp_path: Path) -> None:
    pytest.importorskip("pyarrow.parquet")
    import pyarrow.parquet
    import ray

    photos = [picture(tmp_path / "photos" / f"{number:02}.png", number) for number in range(10)]
    tricks = (("02.png", "fail"), ("05.png", "kill"), ("07.png", "once"))
    url = f"sqlite:///{tmp_path / 'all.db'}"
    job = FakeJob(small_library.path, tricks, tmp_path, url)
    table = tmp_path / "all.parquet"
    told = run(job, photos, tmp_path / "out", RunOptions(parquet=table))
    assert {name: outcome.stage for name, outcome in told.items() if outcome.error} == {
        "02.png": "detect",
        "05.png": "worker",
    }
    assert not any(outcome.resumed for outcome in told.values())
    for outcome in told.values():
        assert outcome.paths.json.is_file() != bool(outcome.error) == outcome.paths.failed.is_file()
    with Store(url) as store:
        assert len(store.photos()) == 8 and len(store.photo_failures()) == 2
    assert pyarrow.parquet.read_table(table).num_rows == 8
    # Finished photos were begun once, also those that lay in one piece with a killer.
    begun = Counter(line.split()[0] for line in (tmp_path / "seen.txt").read_text().splitlines())
    assert {name for name, times in begun.items() if times > 1} == {"05.png", "07.png"}
    assert begun["05.png"] == 2 and not list((tmp_path / "out").glob(".*"))
    assert len([node for node in ray.nodes() if node["Alive"]]) == 2
    again = run(job, photos, tmp_path / "out", RunOptions(resume=True))
    assert all(outcome.resumed for outcome in again.values())
    healed = FakeJob(small_library.path, (), tmp_path, url)
    last = run(healed, photos, tmp_path / "out", RunOptions(resume=True, retry_failed=True))
    assert {name for name, outcome in last.items() if not outcome.resumed} == {"02.png", "05.png"}
    assert not any(outcome.error for outcome in last.values())


@pytest.mark.usefixtures("cluster")
def test_what_every_photo_needs_ends_the_run(small_library: Library, tmp_path: Path) -> None:
    photos = [picture(tmp_path / "photos" / f"{number:02}.png", number) for number in range(3)]
    with pytest.raises(LibraryError, match="There is no CAD library"):
        run(FakeJob(tmp_path / "nowhere"), photos, tmp_path / "out", RunOptions())
    job = FakeJob(small_library.path, (("01.png", "weights"),), tmp_path)
    with pytest.raises(DependencyError, match="the weights are missing"):
        run(job, photos, tmp_path / "out", RunOptions())
