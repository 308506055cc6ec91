"""The story of a run over many photos.

names of the outputs -> what an earlier run has done -> annotate the rest, here or by workers -> pages

A photo that fails is recorded and the others go on. Whatever is killed at whatever moment: files are whole, a
finished photo stays as it is, and ``resume`` does what is missing.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

from cadpose.annotations.files import OutputPaths, output_paths, spare_photos
from cadpose.annotations.store import Store
from cadpose.batch.job import Job
from cadpose.batch.journal import NAME as JOURNAL
from cadpose.batch.journal import Journal
from cadpose.batch.making import Making
from cadpose.batch.outcome import PhotoOutcome, Task, read_document
from cadpose.batch.pages import INDEX, REPORT, RunPages
from cadpose.batch.parquet import need_pyarrow, write_table
from cadpose.batch.photo_files import same_bytes
from cadpose.batch.pool import WorkerPool
from cadpose.batch.ray_run import RayPool, ray_cluster
from cadpose.batch.resume import Earlier, Resume
from cadpose.batch.worker import WRITE, DetectionsOf, PhotoWorker
from cadpose.errors import CadposeError, InputError
from cadpose.pipeline import Annotator

log = logging.getLogger(__name__)

#: A file that a killed run left behind is swept away once it is this old; a younger one may be another's.
_LEFT_BEHIND_SECONDS = 3600.0
#: So many photos in a row whose outputs cannot be written end the run: the disk is full.
_GIVE_UP = 3

#: What is known of a photo before anything is annotated: its outcome, or that it has to be done.
Step = PhotoOutcome | Task
#: Turns steps into outcomes, in any order.
Execute = Callable[[Sequence[Step]], Generator[PhotoOutcome, None, None]]


@dataclass(frozen=True)
class RunOptions:
    """How a run deals with what an earlier one left.

    Attributes:
        resume: Leave photos alone that are done, see :mod:`cadpose.batch.resume`.
        retry_failed: With ``resume``: try those that failed once more.
        names_matter: Photos of the same bytes are each annotated, because what is told of them goes by name.
        parquet: File that gets the annotations of all finished photos of the run, at its end.
    """

    resume: bool = False
    retry_failed: bool = False
    names_matter: bool = False
    parquet: Path | None = None


def annotate_photos(
    annotator: Annotator,
    photos: Sequence[Path],
    out: Path,
    *,
    detections: DetectionsOf | None = None,
    told: str = "",
    store: Store | None = None,
    resume: bool = False,
    retry_failed: bool = False,
) -> Iterator[PhotoOutcome]:
    """Annotate photos one after the other in this process; write outputs and the run's pages to ``out``.

    Args:
        annotator: The annotator.
        photos: Their paths.
        out: Folder of the outputs; made when needed.
        detections: Gives the objects of a photo instead of the detector.
        told: Digest of what ``detections`` tells: with another one ``resume`` does photos again.
        store: Also keeps the documents there, one transaction a photo.
        resume, retry_failed: See :class:`RunOptions`.

    Yields:
        One outcome a photo, in order, as soon as it is written.

    Raises:
        DependencyError: weights or programs are missing that every photo needs.
        CadposeError: ``out`` or the store cannot be written, or an output would replace a photo.
    """
    worker = PhotoWorker(annotator, detections=detections, told=told, store=store)
    options = RunOptions(resume, retry_failed, names_matter=detections is not None)
    yield from _run_here(worker, photos, out, options)


def annotate_job(
    job: Job,
    photos: Sequence[Path],
    out: Path,
    options: RunOptions,
    *,
    workers: int = 1,
    photo_timeout: float | None = 600.0,
    executor: Literal["local", "ray"] = "local",
) -> Iterator[PhotoOutcome]:
    """As :func:`annotate_photos`; more than one worker are processes of their own.

    Args:
        job: Makes a worker.
        photos: Their paths.
        out: Folder of the outputs; made when needed.
        options: How to deal with what an earlier run left.
        workers: How many.
        photo_timeout: Seconds after which a photo has failed; only where there are several workers.
        executor: ``"local"``: see :class:`cadpose.batch.pool.WorkerPool`; ``"ray"``: on a Ray cluster, one
            worker too, see :mod:`cadpose.batch.ray_run`.

    Yields:
        One outcome a photo, in order where there is one worker, else as they come.
    """
    if executor == "local" and workers == 1:
        worker = job.open()
        try:
            yield from _run_here(worker, photos, out, options)
        finally:
            worker.close()
        return
    with _opened_store(job) as store, _pool(job, workers, photo_timeout, executor) as pool:

        def side_by_side(steps: Sequence[Step]) -> Generator[PhotoOutcome, None, None]:
            yield from (step for step in steps if isinstance(step, PhotoOutcome))
            yield from pool.run([step for step in steps if isinstance(step, Task)])

        how = f"by {workers} worker{'s' * (workers > 1)}{' on Ray' * (executor == 'ray')}"
        yield from _run_steps(photos, out, options, store, pool.making(), side_by_side, how)


class Pool(Protocol):
    """Workers that annotate side by side."""

    def making(self) -> Making:
        """What photos will be made with."""
        ...

    def run(self, tasks: Sequence[Task]) -> Iterator[PhotoOutcome]:
        """Annotate photos; one outcome a photo, as they come."""
        ...


@contextmanager
def _pool(job: Job, workers: int, photo_timeout: float | None, executor: str) -> Iterator[Pool]:
    if executor == "ray":
        with ray_cluster():
            yield RayPool(job, workers, photo_timeout=photo_timeout)
    else:
        with WorkerPool(job, workers, photo_timeout=photo_timeout) as pool:
            yield pool


def _run_here(
    worker: PhotoWorker, photos: Sequence[Path], out: Path, options: RunOptions
) -> Iterator[PhotoOutcome]:
    def in_order(steps: Sequence[Step]) -> Generator[PhotoOutcome, None, None]:
        for step in steps:
            yield worker.annotate(step) if isinstance(step, Task) else step

    yield from _run_steps(photos, out, options, worker.store, worker.making, in_order, "one after the other")


@contextmanager
def _opened_store(job: Job) -> Iterator[Store | None]:
    store = job.open_store()
    try:
        yield store
    finally:
        if store is not None:
            store.close()


def _run_steps(
    photos: Sequence[Path],
    out: Path,
    options: RunOptions,
    store: Store | None,
    making: Making,
    execute: Execute,
    how: str,
) -> Iterator[PhotoOutcome]:
    """The run itself, whoever annotates.

    Args:
        photos: Their paths.
        out: Folder of the outputs.
        options: How to deal with what an earlier run left.
        store: Where finished photos are put that it lacks.
        making: What photos will be made with.
        execute: Annotates what has to be done.
        how: The same in words, for the report.
    """
    if options.parquet is not None:
        need_pyarrow()
    journal = Journal(out)
    earlier = Earlier(journal.records())
    twins = {} if options.names_matter else same_bytes(photos)
    own = [photo for photo in dict.fromkeys(photos) if photo not in twins]
    planned = dict(zip(own, output_paths(own, out, earlier.belongs_to_another), strict=True))
    _ready(out, photos, list(planned.values()), options.parquet)
    journal.tidy()
    steps = _steps(planned, Resume(earlier, making, journal, retry_failed=options.retry_failed), options)
    if store is not None:
        _complete(store, steps)
    copies: dict[Path, list[Path]] = {}
    for copy, first in twins.items():
        copies.setdefault(first, []).append(copy)
    pages = RunPages(out, planned, copies=len(twins), how=how)
    unwritten = 0
    outcomes = execute(steps)
    try:
        for outcome in outcomes:
            pages.note(outcome)
            yield outcome
            for copy in copies.get(outcome.photo, ()):
                yield PhotoOutcome(
                    copy, outcome.paths, outcome.record, outcome.error, outcome.stage, same_as=outcome.photo
                )
            unwritten = unwritten + 1 if outcome.stage == WRITE else 0
            if unwritten == _GIVE_UP:
                raise CadposeError(f"stopped: the outputs of {_GIVE_UP} photos in a row could not be written")
    except BaseException:
        # Photos in flight come to their end first; trouble with the pages hides no other.
        try:
            outcomes.close()
        finally:
            with suppress(CadposeError):
                pages.write()
        raise
    pages.write()
    if options.parquet is not None:
        write_table([planned[photo].json for photo in pages.finished_photos()], options.parquet)


def _ready(out: Path, photos: Sequence[Path], planned: Sequence[OutputPaths], parquet: Path | None) -> None:
    """Make the folder and look that no output takes the place of a photo."""
    if parquet is not None:
        spare_photos([parquet], photos, "--parquet")
        if parquet.is_dir():
            raise InputError(f"{parquet} is a folder: name a file with --parquet")
    own = [out / name for name in (INDEX, REPORT, JOURNAL)]
    spare_photos([*own, *(path for paths in planned for path in paths.all())], photos)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for folder in (out, *{paths.thumbnail.parent for paths in planned}):
            _sweep(folder)
    except OSError as error:
        raise InputError(f"{out}: cannot be made ({error.strerror}), choose another --out") from error


def _steps(planned: dict[Path, OutputPaths], resume: Resume, options: RunOptions) -> list[Step]:
    if not options.resume:
        return [Task(photo, paths) for photo, paths in planned.items()]
    steps = [resume.outcome(photo, paths) or Task(photo, paths) for photo, paths in planned.items()]
    resume.tell()
    return steps


def _complete(store: Store, steps: Sequence[Step]) -> None:
    """Put finished photos into a store that lacks them or holds another document of theirs."""
    # Of photos of the same bytes the store keeps one: the last, each time.
    finished = {s.record.sha256: s.paths.json for s in steps if isinstance(s, PhotoOutcome) and s.record}
    documents = (read_document(path) for path in finished.values())
    store.add_many(document for document in documents if document is not None)


def _sweep(folder: Path) -> None:
    for part in folder.glob(".cadpose-*.part"):
        with suppress(FileNotFoundError):  # another run's, moved into place meanwhile
            # An export's is a folder, and may hold what nobody has looked at.
            if part.is_file() and time.time() - part.stat().st_mtime > _LEFT_BEHIND_SECONDS:
                part.unlink()
