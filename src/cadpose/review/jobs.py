"""Photos that are annotated in the background: one thread, one annotator made when the first photo comes."""

from __future__ import annotations

import logging
import secrets
import threading
import time
from collections import OrderedDict, deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from cadpose.annotations.document import Failure, document_from
from cadpose.annotations.store import Store
from cadpose.errors import CadposeError
from cadpose.photos import read_photo
from cadpose.pipeline import Annotator
from cadpose.records import Annotation
from cadpose.review.answers import JobAnswer
from cadpose.review.refusals import RefusedError, not_found
from cadpose.review.waiting import WaitingNotes

log = logging.getLogger(__name__)

#: Photos that may wait, and jobs that are remembered.
MOST_WAITING, MOST_KEPT = 500, 1000
#: Seconds that stopping waits for the photo under way.
_LAST_WAIT = 5.0
_STOPPED = "the server was stopped meanwhile: it goes on with this photo when it is started again"
# Shares of a photo's time that go by before its objects come: reading and finding them.
_READ, _FOUND = 0.05, 0.25


@dataclass(eq=False)
class Job:
    """One photo on its way into the store.

    Attributes:
        id: Its name in URLs.
        name: The photo's.
        path: Its file.
        sha256: Digest of its bytes.
        state: Where it is.
        stage: What is being done, in a word or two.
        share: How much is done, in [0, 1].
        error: Why it failed.
        annotations: Keys of what was found.
        seconds: How long it took, or has taken.
    """

    id: str
    name: str
    path: Path
    sha256: str
    state: Literal["queued", "running", "done", "failed"] = "queued"
    stage: str = "waiting"
    share: float = 0.0
    error: str | None = None
    annotations: tuple[str, ...] = ()
    seconds: float = 0.0
    _begun: float = field(default=0.0, init=False)

    def answer(self) -> JobAnswer:
        """As the page gets it."""
        running = self.state == "running"
        return JobAnswer(
            id=self.id,
            name=self.name,
            state=self.state,
            stage=self.stage,
            share=self.share,
            error=self.error,
            photo_sha256=self.sha256,
            annotations=list(self.annotations),
            seconds=round(time.perf_counter() - self._begun if running else self.seconds, 3),
        )

    def begin(self) -> None:
        """The thread takes it up."""
        self.state, self._begun = "running", time.perf_counter()

    def at(self, stage: str, share: float) -> None:
        """It has come so far."""
        self.stage, self.share = stage, share

    def done(self, annotations: tuple[str, ...]) -> None:
        """All of it is in the store."""
        self._end()
        self.annotations, self.state, self.stage, self.share = annotations, "done", "done", 1.0

    def failed(self, error: str) -> None:
        """It cannot be annotated."""
        self._end()
        self.error, self.state = error, "failed"

    def _end(self) -> None:
        self.seconds = time.perf_counter() - self._begun if self._begun else 0.0


class Jobs:
    """The queue of photos and the thread that works on it.

    Args:
        store: Where annotations go.
        make: Makes the annotator; called in the thread, once.
        notes: Where photos that wait are noted, for the next start; None notes none.
    """

    def __init__(
        self, store: Store, make: Callable[[], Annotator], notes: WaitingNotes | None = None
    ) -> None:
        self._store, self._make, self._notes = store, make, notes
        self._annotator: Annotator | None = None
        self._jobs: OrderedDict[str, Job] = OrderedDict()
        self._waiting: deque[Job] = deque()
        self._changed = threading.Condition()
        self._thread: threading.Thread | None = None
        self._stopping = False

    def add(self, path: Path, name: str, sha256: str) -> Job:
        """Put a photo into the queue; one that waits there already, or is worked on, is given back.

        Raises:
            RefusedError: too many wait.
        """
        with self._changed:
            for job in self._jobs.values():
                if job.sha256 == sha256 and job.state in ("queued", "running"):
                    return job
            if len(self._waiting) >= MOST_WAITING:
                raise RefusedError("busy", f"{MOST_WAITING} photos wait to be annotated: try again later")
            if self._notes is not None:
                self._notes.add(sha256, name)
            job = Job(secrets.token_hex(8), name, path, sha256)
            self._jobs[job.id] = job
            self._forget()
            self._waiting.append(job)
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="annotate", daemon=True)
                self._thread.start()
            self._changed.notify_all()
        return job

    def resume(self, find: Callable[[str, str], Path | None]) -> None:
        """Put into the queue what an earlier start left waiting; what does not fit waits for the next start.

        Args:
            find: Gives a photo's file by digest and name; None where it is gone.
        """
        for sha256, name in [] if self._notes is None else self._notes.all(MOST_WAITING):
            path = find(sha256, name)
            if path is None:
                log.warning("%s waited to be annotated, and is gone", name)
                continue
            try:
                self.add(path, name, sha256)
            except RefusedError:
                return

    def check_room(self) -> None:
        """Refuse before an upload is read what would be refused behind it.

        Raises:
            RefusedError: too many wait.
        """
        with self._changed:
            if len(self._waiting) >= MOST_WAITING:
                raise RefusedError("busy", f"{MOST_WAITING} photos wait to be annotated: try again later")

    def get(self, job_id: str) -> Job:
        """A job.

        Raises:
            RefusedError: there is none of that id.
        """
        with self._changed:
            found = self._jobs.get(job_id)
        if found is None:
            raise not_found("there is no such job, or it ended long ago")
        return found

    def all(self) -> list[Job]:
        """All that are remembered, the newest first."""
        with self._changed:
            return list(reversed(self._jobs.values()))

    def stop(self) -> None:
        """Take up no further photo or object, and wait a little for the one under way.

        It and those that wait stay noted, for the next start.
        """
        with self._changed:
            self._stopping = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join(_LAST_WAIT)

    def _forget(self) -> None:
        over = len(self._jobs) - MOST_KEPT
        ended = [job.id for job in self._jobs.values() if job.state in ("done", "failed")]
        for job_id in ended[: max(over, 0)]:
            del self._jobs[job_id]

    def _work(self) -> None:
        while True:
            with self._changed:
                while not self._waiting and not self._stopping:
                    self._changed.wait()
                if self._stopping:
                    return
                job = self._waiting.popleft()
                job.begin()
            try:
                self._annotate(job)
            except CadposeError as error:
                self._fail(job, str(error).replace(str(job.path), job.name))
            except Exception as error:  # whatever one photo brings to light, the others go on
                log.exception("%s", job.name)
                self._fail(job, f"it cannot be annotated ({type(error).__name__}: {error})")

    def _annotate(self, job: Job) -> None:
        known = self._store.document(job.sha256)
        if known is not None and known.annotations:
            self._finish(job)
            return
        job.at("loading the models", 0.0)
        if self._annotator is None:
            self._annotator = self._make()
        annotator = self._annotator
        job.at("reading the photo", 0.0)
        photo = replace(read_photo(job.path), name=job.name)
        job.at("finding objects", _READ)
        detections = annotator.detector.detect(photo)
        annotations: list[Annotation] = []
        failures: list[Failure] = []
        for number, detection in enumerate(detections):
            if self._stopping:
                raise CadposeError(_STOPPED)
            stage = f"{detection.category}, {number + 1} of {len(detections)}"
            job.at(stage, _FOUND + (1.0 - _FOUND) * number / len(detections))
            result = annotator.run(photo, [detection])
            annotations += result.annotations
            failures += result.failures
        self._store.add(document_from(photo, annotations, failures))
        self._finish(job)

    def _finish(self, job: Job) -> None:
        found = tuple(item.annotation_id for item in self._store.items(job.sha256))
        self._drop_note(job)
        job.done(found)

    def _fail(self, job: Job, reason: str) -> None:
        if self._stopping:
            # No fault of the photo's, perhaps: the store may be closed already.
            job.failed(_STOPPED)
            return
        try:
            self._store.add_failure(job.name, job.sha256, job.stage, reason)
        except CadposeError as error:
            log.warning("%s", error)
        self._drop_note(job)
        job.failed(reason)

    def _drop_note(self, job: Job) -> None:
        if self._notes is not None:
            self._notes.drop(job.sha256)
