"""Worker processes: what a photo does to one of them is no other photo's loss.

A process takes seconds to load its models, so tests that cost some are slow ones.
"""

from __future__ import annotations

import os
import signal
import time
from collections import Counter
from pathlib import Path

import pytest

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.store import Store
from cadpose.batch.failures import read_failure
from cadpose.batch.outcome import PhotoOutcome
from cadpose.batch.pool import WorkerPool
from cadpose.batch.run import RunOptions, annotate_job
from cadpose.errors import CadposeError, DependencyError, LibraryError
from cadpose.library.catalogue import Library
from tests.batch.fakes import FakeJob, files, picture

RESUME = RunOptions(resume=True)


@pytest.fixture
def many(tmp_path: Path) -> list[Path]:
    return [picture(tmp_path / "photos" / f"{number:02}.png", number) for number in range(8)]


def run(
    job: FakeJob, photos: list[Path], out: Path, options: RunOptions | None = None, timeout: float = 60.0
) -> dict[str, PhotoOutcome]:
    outcomes = annotate_job(job, photos, out, options or RunOptions(), workers=2, photo_timeout=timeout)
    told = list(outcomes)
    assert len(told) == len(photos)
    return {outcome.photo.name: outcome for outcome in told}


def seen(folder: Path) -> Counter[str]:
    """How often each photo was begun."""
    return Counter(line.split()[0] for line in (folder / "seen.txt").read_text().splitlines())


def test_two_workers_do_what_one_does(small_library: Library, many: list[Path], tmp_path: Path) -> None:
    url = f"sqlite:///{tmp_path / 'all.db'}"
    job = FakeJob(small_library.path, folder=tmp_path, store=url)
    told = run(job, many, tmp_path / "two")
    assert not any(outcome.error or outcome.resumed for outcome in told.values())
    pids = {line.split()[1] for line in (tmp_path / "seen.txt").read_text().splitlines()}
    assert len(pids) == 2 and str(os.getpid()) not in pids
    list(annotate_job(job, many, tmp_path / "one", RunOptions()))

    def documents(out: Path) -> dict[str, AnnotationDocument]:
        found = {}
        for name, data in files(out).items():
            if name.endswith(".json"):
                document = AnnotationDocument.from_json(data.decode())
                untimed = [part.model_copy(update={"seconds": {}}) for part in document.annotations]
                found[name] = document.model_copy(update={"annotations": tuple(untimed)})
        return found

    assert (
        documents(tmp_path / "one") == documents(tmp_path / "two") and len(documents(tmp_path / "two")) == 8
    )
    with Store(url) as store:
        assert len(store.photos()) == 8
    index = (tmp_path / "two" / "index.html").read_text()
    assert all(f"{number:02}.card.html" in index for number in range(8))


@pytest.mark.slow
def test_a_worker_that_dies_costs_its_photo_alone(
    small_library: Library, many: list[Path], tmp_path: Path
) -> None:
    """One photo kills whatever holds it, one ends it, one killed by chance: the last is done in the end."""
    out = tmp_path / "out"
    tricks = (("01.png", "kill"), ("03.png", "exit"), ("04.png", "once"), ("05.png", "fail"))
    job = FakeJob(small_library.path, tricks, tmp_path, f"sqlite:///{tmp_path / 'all.db'}")
    told = run(job, many, out)
    failed = {name: outcome for name, outcome in told.items() if outcome.error}
    assert set(failed) == {"01.png", "03.png", "05.png"}
    assert "its worker was killed by SIGKILL (perhaps for want of memory), twice" in failed["01.png"].error
    assert "its worker ended with exit code 3, twice" in failed["03.png"].error
    assert [failed[name].stage for name in sorted(failed)] == ["worker", "worker", "detect"]
    assert seen(tmp_path) == Counter({f"{n:02}.png": 2 if n in (1, 3, 4) else 1 for n in range(8)})
    for name, outcome in told.items():
        assert outcome.paths.failed.is_file() == (name in failed) != outcome.paths.json.is_file()
        if name in failed:
            told_failure = read_failure(outcome.paths.failed)
            assert told_failure is not None and told_failure.reason == outcome.error
            assert str(outcome.photo) in outcome.error
    with Store(f"sqlite:///{tmp_path / 'all.db'}") as store:
        assert len(store.photos()) == 5
    # A second run leaves all of them alone, a third tries the failures again.
    again = run(job, many, out, RESUME)
    assert all(outcome.resumed for outcome in again.values())
    assert {name for name, outcome in again.items() if outcome.error} == set(failed)
    assert sum(seen(tmp_path).values()) == 11
    healed = FakeJob(small_library.path, (), tmp_path, job.store)
    last = run(healed, many, out, RunOptions(resume=True, retry_failed=True))
    assert {name for name, outcome in last.items() if not outcome.resumed} == set(failed)
    assert not any(outcome.error or outcome.paths.failed.exists() for outcome in last.values())
    with Store(f"sqlite:///{tmp_path / 'all.db'}") as store:
        assert len(store.photos()) == 8


@pytest.mark.slow
def test_a_photo_that_was_written_before_its_worker_died_is_done(
    small_library: Library, many: list[Path], tmp_path: Path
) -> None:
    told = run(FakeJob(small_library.path, (("01.png", "late"),), tmp_path), many[:3], tmp_path / "out")
    assert not any(outcome.error or outcome.resumed for outcome in told.values())
    assert set(seen(tmp_path).values()) == {1}


@pytest.mark.slow
def test_a_photo_that_hangs_is_given_up(small_library: Library, many: list[Path], tmp_path: Path) -> None:
    job = FakeJob(small_library.path, (("02.png", "hang"),), tmp_path)
    told = run(job, many[:4], tmp_path / "out", timeout=20.0)
    assert [name for name, outcome in told.items() if outcome.error] == ["02.png"]
    assert told["02.png"].stage == "timeout"
    assert "took longer than 20 seconds, twice, the second time alone" in told["02.png"].error


@pytest.mark.slow
def test_what_every_photo_needs_ends_the_run(
    small_library: Library, many: list[Path], tmp_path: Path
) -> None:
    job = FakeJob(small_library.path, (("00.png", "weights"),), tmp_path)
    with pytest.raises(DependencyError, match="the weights are missing"):
        run(job, many, tmp_path / "out")
    with pytest.raises(LibraryError, match="There is no CAD library"):
        run(FakeJob(tmp_path / "nowhere"), many, tmp_path / "out")


@pytest.mark.slow
def test_workers_that_die_as_they_start(small_library: Library, many: list[Path], tmp_path: Path) -> None:
    """Two may, by chance; when all of them do, the run says so."""
    (tmp_path / "few").mkdir()
    told = run(FakeJob(small_library.path, folder=tmp_path / "few", stillborn=2), many[:3], tmp_path / "out")
    assert not any(outcome.error for outcome in told.values())
    (tmp_path / "all").mkdir()
    with pytest.raises(CadposeError, match="each of 3 workers was killed by SIGKILL"):
        run(FakeJob(small_library.path, folder=tmp_path / "all", stillborn=99), many, tmp_path / "none")


@pytest.mark.slow
def test_a_worker_killed_from_outside(small_library: Library, many: list[Path], tmp_path: Path) -> None:
    job = FakeJob(small_library.path, folder=tmp_path, seconds=0.2)
    told: list[PhotoOutcome] = []
    for outcome in annotate_job(job, many, tmp_path / "out", RunOptions(), workers=2):
        told.append(outcome)
        if len(told) == 2:
            pid = int((tmp_path / "seen.txt").read_text().split()[-1])
            os.kill(pid, signal.SIGKILL)
    assert len(told) == 8 and not any(outcome.error for outcome in told)


@pytest.mark.slow
def test_a_stopped_run_keeps_what_is_in_flight(
    small_library: Library, many: list[Path], tmp_path: Path
) -> None:
    job = FakeJob(small_library.path, folder=tmp_path, seconds=0.3)
    outcomes = annotate_job(job, many, tmp_path / "out", RunOptions(), workers=2)
    next(outcomes)
    time.sleep(0.1)
    with pytest.raises(KeyboardInterrupt):
        outcomes.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
    begun, done = seen(tmp_path), list((tmp_path / "out").glob("*.json"))
    assert len(done) == len(begun) < 8
    index = (tmp_path / "out" / "index.html").read_text()
    assert all(f"{path.stem}.card.html" in index for path in done), "pages come after what was in flight"
    again = run(job, many, tmp_path / "out", RESUME)
    assert sum(outcome.resumed for outcome in again.values()) == len(done)
    assert all(times == 1 for times in seen(tmp_path).values())


def test_cores_are_divided(small_library: Library, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cadpose.batch.pool.cores", lambda: 9)
    assert [WorkerPool(FakeJob(small_library.path), n)._threads for n in (2, 4, 20)] == [4, 2, 1]
