"""One photo of a run, whole: read it, annotate it, draw it, store it, write it.

files beside their places -> store -> journal -> files into place, the document last: a photo whose document
is there is in the store too, and a run that is killed on the way does this photo once more, with the same
result. What an earlier run left is touched only when all else is done.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

from cadpose.annotations.files import OutputPaths
from cadpose.annotations.store import Store
from cadpose.batch.failures import forget_failure, record_failure
from cadpose.batch.journal import Journal
from cadpose.batch.making import TOLD, Making
from cadpose.batch.outcome import PhotoOutcome, Task
from cadpose.batch.outputs import Drawn, draw_outputs
from cadpose.batch.photo_files import file_mark
from cadpose.batch.record import record_of
from cadpose.errors import CadposeError, DependencyError
from cadpose.photos import read_photo
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo
from cadpose.stopwatch import Stopwatch

log = logging.getLogger(__name__)

#: Objects of a photo that are known from outside.
DetectionsOf = Callable[[Photo], list[Detection]]


class PhotoWorker:
    """Annotates photos one by one and writes what comes of each.

    Args:
        annotator: The annotator.
        detections: Gives the objects of a photo instead of the detector.
        told: Digest of what ``detections`` tells.
        store: Also keeps the documents there, one transaction a photo.
    """

    def __init__(
        self,
        annotator: Annotator,
        *,
        detections: DetectionsOf | None = None,
        told: str = "",
        store: Store | None = None,
    ) -> None:
        self.annotator, self.detections, self.store = annotator, detections, store
        told = told or ("somebody" if detections is not None else "")
        self.making = Making(annotator.provenance(), told, annotator.categories)

    def close(self) -> None:
        """Close the store."""
        if self.store is not None:
            self.store.close()

    def annotate(self, task: Task) -> PhotoOutcome:
        """Annotate a photo and write its outputs, or why it failed.

        A photo whose outputs cannot be written has failed, but that is not kept: it is no fault of its own.

        Raises:
            DependencyError: weights or programs are missing that every photo needs.
            CadposeError: the store cannot be written.
        """
        photo, mark, clock = task.photo, file_mark(task.photo), Stopwatch("read")
        try:
            drawn = self._drawn(photo, clock)
        except DependencyError:
            raise
        except CadposeError as error:
            reason = str(error)
        except Exception as error:  # whatever one photo brings to light, the others go on
            log.debug("%s", photo, exc_info=True)
            reason = f"cannot be annotated ({type(error).__name__}: {error}), --verbose tells more"
        else:
            return self._written(task, drawn, clock.seconds, mark)
        return record_failure(photo, task.paths, clock.stage, reason, self.making.key, self.store)

    def _drawn(self, photo: Path, clock: Stopwatch) -> Drawn:
        with clock.time("read"):
            picture = read_photo(photo)
        with clock.time("detect" if self.detections is None else "told"):
            known = (self.detections or self.annotator.detector.detect)(picture)
        clock.stage = "annotate"
        result = self.annotator.run(picture, known)
        for stage, seconds in result.seconds.items():
            clock.seconds[stage] = clock.seconds.get(stage, 0.0) + seconds
        if self.detections is not None:
            own = [replace(a, provenance={**a.provenance, "detector": TOLD}) for a in result.annotations]
            result = replace(result, annotations=tuple(own))
        with clock.time("draw"):
            return draw_outputs(self.annotator, result)

    def _written(
        self, task: Task, drawn: Drawn, seconds: dict[str, float], mark: tuple[int, int]
    ) -> PhotoOutcome:
        photo, paths, start = task.photo, task.paths, time.perf_counter()
        with ExitStack() as files:
            try:
                move = files.enter_context(drawn.beside(paths))
            except CadposeError as error:
                return _not_written(photo, paths, error)
            if self.store is not None:
                self.store.add(drawn.document)
            record = record_of(
                drawn.document,
                made_with=self.making.key,
                seconds=seconds | {"write": time.perf_counter() - start},
                file=mark,
                output_bytes=drawn.sizes,
            )
            try:
                Journal(paths.json.parent).append(paths.stem, record)
                move()
            except CadposeError as error:
                return _not_written(photo, paths, error)
        forget_failure(paths)
        return PhotoOutcome(photo, paths, record)


#: Stage of a photo whose outputs could not be written.
WRITE = "write"


def _not_written(photo: Path, paths: OutputPaths, error: CadposeError) -> PhotoOutcome:
    return PhotoOutcome(photo, paths, error=f"{photo}: {error}", stage=WRITE)
