"""The same run over a Ray cluster: Ray Data hands the photos to actors, each with its models loaded once.

Photos, library and output folder lie on a file system that all nodes share. Actors write the outputs
themselves, as local workers do, so that what is lost with an actor or a node is the photos that it held. Ray
gives their piece to another actor, again and again; a note beside the outputs says how often a photo was
begun, so that one that ends its actor twice has failed.
"""

from __future__ import annotations

import logging
import math
import os
import pickle
import secrets
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from cadpose.annotations.files import OutputPaths
from cadpose.batch.failures import record_failure
from cadpose.batch.job import Job
from cadpose.batch.making import Making
from cadpose.batch.outcome import PhotoOutcome, Task
from cadpose.batch.resume import finished
from cadpose.batch.worker import PhotoWorker
from cadpose.errors import CadposeError, DependencyError
from cadpose.threads import limit_threads

log = logging.getLogger(__name__)

#: Photos that an actor holds at once.
_PIECE = 4
#: So often a photo may be begun.
_TRIES = 2
_BEGUN, _DONE = b"x", b"."
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
            "run": secrets.token_hex(4),
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
        if not tasks:
            return
        import ray
        from ray.data import ActorPoolStrategy, DataContext

        context = DataContext.get_current()
        context.enable_progress_bars = False
        items = [{"task": pickle.dumps(task)} for task in tasks]
        photos = ray.data.from_items(items, override_num_blocks=math.ceil(len(items) / _PIECE))
        done = photos.map_batches(
            _Actor,
            fn_constructor_kwargs={"settings": self._settings},
            compute=ActorPoolStrategy(size=self._workers, max_tasks_in_flight_per_actor=1),
            batch_size=_PIECE,
            batch_format="numpy",
            num_cpus=1,
        )
        for row in done.iter_rows():
            told = pickle.loads(row["outcome"])  # made by our own actor a moment ago
            if isinstance(told, CadposeError):
                raise told
            _Note(str(self._settings["run"]), told.paths).remove()
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


class _Note:
    """How often a photo was begun in a run, kept beside its outputs until the run has its outcome."""

    def __init__(self, run: str, paths: OutputPaths) -> None:
        # Swept away as any other leftover where the run is killed.
        self._path = paths.json.with_name(f".cadpose-{run}-{paths.stem}.part")

    def read(self) -> tuple[int, bool]:
        """So often, and whether the last time came to an end."""
        try:
            told = self._path.read_bytes()
        except OSError:
            return 0, False
        return told.count(_BEGUN), told.endswith(_DONE)

    def add(self, what: bytes) -> None:
        """Begun once more, or done."""
        with suppress(OSError), self._path.open("ab") as file:
            file.write(what)

    def remove(self) -> None:
        """The photo is done."""
        with suppress(OSError):
            self._path.unlink(missing_ok=True)


class _Actor:
    """A worker of the run in an actor of Ray Data."""

    def __init__(self, settings: dict[str, Any]) -> None:
        self._worker = _worker(settings)
        self._timeout: float | None = settings["timeout"]
        self._run: str = settings["run"]

    def __call__(self, batch: dict[str, Any]) -> dict[str, Any]:
        import numpy as np

        told: list[bytes] = []
        for packed in batch["task"]:
            try:
                outcome: object = self._annotate(pickle.loads(packed))  # made by our own driver
            except CadposeError as error:
                outcome = error
            told.append(pickle.dumps(outcome))
        return {"outcome": np.array(told, dtype=object)}

    def _annotate(self, task: Task) -> PhotoOutcome:
        note = _Note(self._run, task.paths)
        begun, done = note.read()
        if begun:
            # Its piece comes again: another photo of it may have ended the actor after this one was done.
            outcome = finished(task, self._worker.making, failed=done)
            if outcome is not None:
                return outcome
        if begun >= _TRIES and not done:
            reason = f"its worker died or took too long, {_TRIES} times"
            making, store = self._worker.making, self._worker.store
            return record_failure(task.photo, task.paths, "worker", reason, making.key, store)
        note.add(_BEGUN)
        with _no_longer_than(self._timeout):
            outcome = self._worker.annotate(task)
        note.add(_DONE)
        return outcome


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
        sys.stderr.write(f"a photo took longer than {seconds:g} seconds\n")
        sys.stderr.flush()
        os._exit(1)

    timer = threading.Timer(seconds, end)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
