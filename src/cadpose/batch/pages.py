"""The pages of a run, written every so often while it goes on and at its end: gallery and report."""

from __future__ import annotations

import logging
import time
from collections.abc import Mapping
from pathlib import Path

from cadpose.annotations.files import OutputPaths, write_atomic
from cadpose.annotations.parts import plain_text
from cadpose.batch.figures import FailedPhoto, run_figures
from cadpose.batch.gallery import index_html
from cadpose.batch.journal import Journal
from cadpose.batch.outcome import PhotoOutcome
from cadpose.batch.record import PhotoRecord
from cadpose.batch.report import Pace, report_html
from cadpose.errors import CadposeError

log = logging.getLogger(__name__)

INDEX, REPORT = "index.html", "report.html"
#: Seconds between two writings, and how many times as long as a writing takes.
_EVERY, _TIMES = 60.0, 20.0


class RunPages:
    """Index and report of one run; what was found is read from the journal when they are written.

    Args:
        out: The output folder.
        planned: Photos of the run and their outputs.
        copies: Photos that hold the bytes of another one.
        how: How photos are annotated, for example ``"by 2 workers"``.
    """

    def __init__(self, out: Path, planned: Mapping[Path, OutputPaths], *, copies: int, how: str) -> None:
        self._out, self._planned, self._copies, self._how = out, planned, copies, how
        self._failed: dict[Path, FailedPhoto] = {}
        self._done = 0
        self._start = time.monotonic()
        self._next = self._start + _EVERY

    def note(self, outcome: PhotoOutcome) -> None:
        """Take in what came of a photo, and write the pages if it is time."""
        if outcome.error:
            photo = plain_text(str(outcome.photo))
            self._failed[outcome.photo] = FailedPhoto(photo, outcome.stage, outcome.error)
        self._done += not outcome.resumed
        if time.monotonic() >= self._next:
            start = time.monotonic()
            try:
                self.write(running=True)
            except CadposeError as error:
                log.debug("%s", error)  # told at the end
            spent = time.monotonic() - start
            self._next = start + max(_EVERY, _TIMES * spent)

    def write(self, *, running: bool = False) -> None:
        """Write both.

        Raises:
            CadposeError: one cannot be written.
        """
        seconds = time.monotonic() - self._start
        finished = self._finished()
        write_atomic(self._out / INDEX, index_html(finished).encode())
        figures = run_figures(
            finished, list(self._failed.values()), planned=len(self._planned), copies=self._copies
        )
        pace = Pace(self._done, seconds, self._how, running)
        write_atomic(self._out / REPORT, report_html(figures, pace, finished).encode())

    def finished_photos(self) -> list[Path]:
        """Photos of the run that are finished."""
        return [p for p, paths in self._planned.items() if p not in self._failed and paths.json.is_file()]

    def _finished(self) -> list[tuple[str, PhotoRecord]]:
        """Photos of the run whose document is there, in the run's order."""
        records = Journal(self._out).records()
        return [
            (paths.stem, records[paths.stem])
            for photo, paths in self._planned.items()
            if paths.stem in records and photo not in self._failed and paths.json.is_file()
        ]
