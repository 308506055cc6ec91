"""The same run over a Ray cluster: Ray Data hands the photos to actors, each with its models loaded once.

Photos, library and output folder lie on a file system that all nodes share. Actors write the outputs
themselves, as local workers do, so that what is lost with an actor or a node is the photos that it held;
those are tried once more, one at a time, and have failed if that fails too.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from cadpose.batch.failures import record_failure
from cadpose.batch.job import Job
from cadpose.batch.journal import Journal
from cadpose.batch.making import Making
from cadpose.batch.outcome import PhotoOutcome, Task
from cadpose.batch.resume import Earlier, Resume
from cadpose.batch.worker import PhotoWorker
from cadpose.errors import CadposeError, DependencyError
from cadpose.threads import limit_threads

log = logging.getLogger(__name__)

#: Photos that an actor holds at once.
_PIECE = 4
#: Environment that decides what a run does, and so goes to the actors.
_PASSED_ON = ("CADPOSE_", "NUMBA_CACHE_DIR", "PYTHONPATH")
_QUIET = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_DEDUP_LOGS": "0",
    "RAY_DATA_DISABLE_PROGRESS_BARS": "1",
    "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0",
}


class RayPool:
    """Actors of one run, on the cluster that ``RAY_ADDRESS`` names, else on this machine alone.

    Args:
        job: Makes a worker.
        workers: How many actors; each takes one CPU of the cluster.
        photo_timeout: Seconds after which a photo has failed; None waits for ever.

    Raises:
        DependencyError: Ray is not installed.
        CadposeError: the cluster cannot be reached, or what the job needs is missing there.
    """

    def __init__(self, job: Job, workers: int, *, photo_timeout: float | None = 600.0) -> None:
        self._job, self._workers, self._timeout = job, workers, photo_timeout
        self._settings = {
            "job_bytes": pickle.dumps(job),
            "folder": str(Path.cwd()),
            "level": logging.getLogger("cadpose").getEffectiveLevel(),
            "timeout": photo_timeout,
        }
        self._making: Making | None = None

    def making(self) -> Making:
        """What photos will be made with, as a worker on the cluster tells.

        Raises:
            CadposeError: what the job needs is missing there.
        """
        if self._making is None:
            import ray

            told = ray.get(ray.remote(num_cpus=1)(_making).remote(self._settings))
            if isinstance(told, CadposeError):
                raise told
            self._making = told
        return self._making

    def run(self, tasks: Sequence[Task]) -> Iterator[PhotoOutcome]:
        """Annotate photos.

        Yields:
            One outcome a photo, as they come.

        Raises:
            CadposeError: something is missing that every photo needs, or the store cannot be written.
        """
        left = {str(task.photo): task for task in tasks}
        for piece in (_PIECE, 1):
            for outcome in self._pass(list(left.values()), piece) if left else ():
                del left[str(outcome.photo)]
                yield outcome
        store = self._job.open_store() if left else None
        try:
            for task in left.values():
                reason = "its worker died or took too long, twice, the second time with no other photo"
                yield record_failure(task.photo, task.paths, "worker", reason, self.making().key, store)
        finally:
            if store is not None:
                store.close()

    def _pass(self, tasks: Sequence[Task], piece: int) -> Iterator[PhotoOutcome]:
        import ray
        from ray.data import ActorPoolStrategy, DataContext

        # A piece whose actor dies is given up; its photos come again in the next pass.
        context = DataContext.get_current()
        context.max_errored_blocks = -1
        context.enable_progress_bars = False
        context.actor_init_retry_on_errors = False
        items = [{"task": pickle.dumps(task)} for task in tasks]
        photos = ray.data.from_items(items, override_num_blocks=math.ceil(len(items) / piece))
        done = photos.map_batches(
            _Actor,
            fn_constructor_kwargs={"settings": self._settings, "again": piece == 1},
            compute=ActorPoolStrategy(size=self._workers, max_tasks_in_flight_per_actor=1),
            batch_size=piece,
            batch_format="numpy",
            num_cpus=1,
            max_restarts=-1,
            max_task_retries=0,
        )
        for row in done.iter_rows():
            told = pickle.loads(row["outcome"])  # made by our own actor a moment ago
            if isinstance(told, CadposeError):
                raise told
            yield told


@contextmanager
def ray_cluster() -> Iterator[None]:
    """A connection to the cluster, quiet and without telemetry; ended where it was made here.

    Raises:
        DependencyError: Ray is not installed.
        CadposeError: the cluster cannot be reached.
    """
    for name, value in _QUIET.items():
        os.environ.setdefault(name, value)
    try:
        import ray
        import ray.data
    except ImportError as error:
        raise DependencyError(
            f"--executor ray needs Ray Data ({error}): install it with pip install 'cadpose[ray]'"
        ) from None
    if ray.is_initialized():
        yield
        return
    passed = {name: value for name, value in os.environ.items() if name.startswith(_PASSED_ON)}
    address = os.environ.get("RAY_ADDRESS")
    try:
        ray.init(
            address=address or "local",
            include_dashboard=None if address else False,
            log_to_driver=False,
            logging_level=logging.ERROR,
            runtime_env={"env_vars": passed | _QUIET},
        )
    except (ConnectionError, RuntimeError, ValueError) as error:
        reason = str(error).splitlines()[0][:200]
        raise CadposeError(
            f"cannot reach the Ray cluster ({reason}): start one with `ray start --head` and name it in "
            f"RAY_ADDRESS, or leave that unset"
        ) from None
    logging.getLogger("ray").setLevel(logging.ERROR)
    try:
        yield
    finally:
        ray.shutdown()


class _Actor:
    """A worker of the run in an actor of Ray Data."""

    def __init__(self, settings: dict[str, Any], again: bool) -> None:
        self._worker = _worker(settings)
        self._timeout: float | None = settings["timeout"]
        self._again = again

    def __call__(self, batch: dict[str, Any]) -> dict[str, Any]:
        import numpy as np

        told: list[bytes] = []
        for packed in batch["task"]:
            task: Task = pickle.loads(packed)
            try:
                outcome: object = self._annotate(task)
            except CadposeError as error:
                outcome = error
            told.append(pickle.dumps(outcome))
        return {"outcome": np.array(told, dtype=object)}

    def _annotate(self, task: Task) -> PhotoOutcome:
        if self._again:
            # Another photo of its piece may have cost the actor its life after this one was done.
            journal = Journal(task.paths.json.parent)
            earlier = Earlier(journal.records())
            resume = Resume(earlier, self._worker.making, journal, retry_failed=True)
            done = resume.outcome(task.photo, task.paths)
            if done is not None:
                return replace(done, resumed=False)
        with _no_longer_than(self._timeout):
            return self._worker.annotate(task)


def _worker(settings: dict[str, Any]) -> PhotoWorker:
    os.chdir(settings["folder"])
    logging.getLogger("cadpose").setLevel(settings["level"])
    # Ray gives an actor one CPU.
    limit_threads(1)
    job: Job = pickle.loads(settings["job_bytes"])
    return job.open()


def _making(settings: dict[str, Any]) -> Making | CadposeError:
    try:
        worker = _worker(settings)
        worker.close()
    except CadposeError as error:
        return error
    return worker.making


@contextmanager
def _no_longer_than(seconds: float | None) -> Iterator[None]:
    """Ends the process, whatever it is doing, when what is done inside takes longer."""
    import threading

    if seconds is None:
        yield
        return

    def end() -> None:
        print(f"a photo took longer than {seconds:g} seconds", file=sys.stderr, flush=True)  # noqa: T201
        os._exit(1)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
