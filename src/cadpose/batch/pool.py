"""Worker processes that annotate photos side by side and survive whatever a photo does to one of them.

A worker holds one photo at a time. One that dies or takes too long with its photo is replaced, and the photo,
unless all of it was written, is tried once more when all others are done, alone on the machine; if that fails
too, the photo has failed.
"""

from __future__ import annotations

import logging
import multiprocessing
import pickle
import signal
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from types import TracebackType
from typing import Self

from cadpose.batch.failures import record_failure
from cadpose.batch.job import Job
from cadpose.batch.making import Making
from cadpose.batch.messages import Broken, Done, Logged, Message, Ready
from cadpose.batch.outcome import PhotoOutcome, Task
from cadpose.batch.process import serve
from cadpose.batch.resume import finished
from cadpose.errors import CadposeError
from cadpose.threads import cores

log = logging.getLogger(__name__)

#: Workers that may die one after the other before they are ready.
_STILLBORN = 3
#: How long photos in flight may take when a run is stopped, seconds.
_GRACE = 10.0


@dataclass(eq=False)
class _Member:
    """One worker process, and the photo that it holds."""

    process: SpawnProcess
    connection: Connection
    ready: bool = False
    task: Task | None = None
    since: float = field(default_factory=time.monotonic)


class WorkerPool:
    """Workers of one run.

    Args:
        job: Makes a worker.
        workers: How many.
        photo_timeout: Seconds after which a photo has taken too long; None waits for ever.
        threads: Threads a worker computes with; by default the machine's cores are divided.

    Raises:
        CadposeError: what the job needs is missing, or the workers die as they start.
    """

    def __init__(
        self, job: Job, workers: int, *, photo_timeout: float | None = 600.0, threads: int | None = None
    ) -> None:
        if workers < 1:
            raise ValueError(f"a pool needs 1 worker or more, got {workers}")
        self._job, self._job_bytes = job, pickle.dumps(job)
        self._timeout = photo_timeout
        self._threads = threads or max(1, cores() // workers)
        self._context = multiprocessing.get_context("spawn")
        self._size, self._stillborn = workers, 0
        self._members: list[_Member] = []
        self._suspects: deque[Task] = deque()
        self._alone = False
        self._making: Making | None = None

    def __enter__(self) -> Self:
        try:
            while len(self._members) < self._size:
                self._start()
        except BaseException:
            self._end_all()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end_all()

    def making(self) -> Making:
        """What photos will be made with, as the first worker that is ready tells.

        Raises:
            CadposeError: no worker gets ready.
        """
        while self._making is None:
            for _ in self._heard(None):
                raise AssertionError("no photo was handed out")
        return self._making

    def run(self, tasks: Sequence[Task]) -> Iterator[PhotoOutcome]:
        """Annotate photos.

        Yields:
            One outcome a photo, as they come.

        Raises:
            CadposeError: something is missing that every photo needs, or the store cannot be written.
        """
        try:
            yield from self._outcomes(tasks)
        except CadposeError:
            raise
        except BaseException:
            # Stopped: what is in flight is written first. A second Ctrl-C ends the wait.
            self._finish_flights()
            raise

    def _outcomes(self, tasks: Sequence[Task]) -> Iterator[PhotoOutcome]:
        todo = deque(tasks)
        while True:
            if not todo and self._suspects and not self._alone and not self._busy():
                self._be_alone()
            self._hand_out(self._suspects if self._alone else todo)
            if not todo and not self._busy() and not self._suspects:
                return
            yield from self._heard(self._wait_seconds())

    # -- handing out and hearing back ------------------------------------------------------------

    def _busy(self) -> list[_Member]:
        return [member for member in self._members if member.task is not None]

    def _hand_out(self, todo: deque[Task]) -> None:
        for member in self._members:
            if todo and member.ready and member.task is None:
                task = todo.popleft()
                try:
                    member.connection.send(task)
                except OSError:  # it died idle; its end is heard of next
                    todo.appendleft(task)
                    continue
                member.task, member.since = task, time.monotonic()

    def _be_alone(self) -> None:
        """Photos that cost a worker its life are tried again with the whole memory of the machine."""
        self._alone = True
        self._end_all()
        self._start()

    def _wait_seconds(self) -> float | None:
        if self._timeout is None:
            return None
        ends = [member.since + self._timeout for member in self._busy()]
        return max(0.0, min(ends) - time.monotonic()) if ends else None

    def _heard(self, seconds: float | None) -> Iterator[PhotoOutcome]:
        """Wait until a worker speaks, dies or has taken too long, and answer that."""
        heard = wait([end for m in self._members for end in (m.connection, m.process.sentinel)], seconds)
        spoke = [m for m in self._members if m.connection in heard or m.process.sentinel in heard]
        for member in spoke:
            alive = True
            # What it said before it died counts.
            while alive and member.connection.poll():
                try:
                    message: Message = member.connection.recv()
                except (EOFError, OSError, pickle.UnpicklingError):
                    alive = False
                else:
                    yield from self._told(member, message)
            if not alive or not member.process.is_alive():
                yield from self._died(member)
        for member in self._busy():
            if self._timeout is not None and time.monotonic() - member.since > self._timeout:
                yield from self._lost(member, "timeout", f"took longer than {self._timeout:g} seconds")

    def _told(self, member: _Member, message: Message) -> Iterator[PhotoOutcome]:
        if isinstance(message, Ready):
            member.ready, self._making, self._stillborn = True, message.making, 0
        elif isinstance(message, Done):
            member.task = None
            yield message.outcome
        elif isinstance(message, Logged):
            record = logging.makeLogRecord(message.fields)
            logging.getLogger(record.name).handle(record)
        elif isinstance(message, Broken):
            raise message.error()

    def _died(self, member: _Member) -> Iterator[PhotoOutcome]:
        member.process.join(_GRACE)
        how = _how_it_ended(member.process.exitcode)
        if not member.ready:
            self._stillborn += 1
            if self._stillborn >= _STILLBORN:
                raise CadposeError(
                    f"each of {self._stillborn} workers {how} while it loaded its models: free memory, or "
                    f"choose fewer with --workers"
                )
        yield from self._lost(member, "worker", f"its worker {how}")

    def _lost(self, member: _Member, stage: str, reason: str) -> Iterator[PhotoOutcome]:
        """Replace a worker; its photo is put off, or has failed if this was its second try."""
        task = member.task
        self._end(member)
        self._members.remove(member)
        if task is not None:
            log.debug("%s: %s", task.photo, reason)
            outcome = None if self._making is None else finished(task, self._making)
            if outcome is not None:
                yield outcome
            elif self._alone:
                yield self._failed(task, stage, f"{reason}, twice, the second time alone")
            else:
                self._suspects.append(task)
        self._start()

    def _failed(self, task: Task, stage: str, reason: str) -> PhotoOutcome:
        made_with = "" if self._making is None else self._making.key
        store = self._job.open_store()
        try:
            return record_failure(task.photo, task.paths, stage, reason, made_with, store)
        finally:
            if store is not None:
                store.close()

    # -- processes -------------------------------------------------------------------------------

    def _start(self) -> None:
        ours, theirs = self._context.Pipe()
        level = logging.getLogger("cadpose").getEffectiveLevel()
        process = self._context.Process(
            target=serve, args=(theirs, self._job_bytes, self._threads, level), daemon=True
        )
        with _no_ctrl_c():
            process.start()
        theirs.close()
        self._members.append(_Member(process, ours))

    def _finish_flights(self) -> None:
        """Let the photos in flight be written."""
        end = time.monotonic() + _GRACE
        with suppress(CadposeError):
            while self._busy() and time.monotonic() < end:
                heard = wait([m.connection for m in self._busy()], max(0.0, end - time.monotonic()))
                for member in [m for m in self._busy() if m.connection in heard]:
                    try:
                        message = member.connection.recv()
                    except (EOFError, OSError, pickle.UnpicklingError):
                        member.task = None
                    else:
                        for _ in self._told(member, message):
                            pass

    def _end_all(self) -> None:
        idle = [member for member in self._members if member.task is None and member.ready]
        for member in idle:
            with suppress(OSError):
                member.connection.send(None)
        for member in idle:
            member.process.join(_GRACE)
        for member in self._members:
            self._end(member)
        self._members.clear()

    def _end(self, member: _Member) -> None:
        """End a process, whatever it is doing: files are written whole, transactions too."""
        if member.process.is_alive():
            member.process.kill()
        member.process.join()
        member.connection.close()
        member.process.close()


def _how_it_ended(code: int | None) -> str:
    if code is not None and code < 0:
        with suppress(ValueError):
            name = signal.Signals(-code).name
            why = " (perhaps for want of memory)" if -code == signal.SIGKILL else ""
            return f"was killed by {name}{why}"
    return f"ended with exit code {code}"


@contextmanager
def _no_ctrl_c() -> Iterator[None]:
    """Processes started here are deaf to Ctrl-C from their first moment; ours is only put off."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
