"""What an earlier run of the same folder has done, and what --resume leaves alone.

A photo is left alone if its document was made from the bytes that the photo has now, all of its files are
whole, and it was made with what it would be made with now (:mod:`cadpose.batch.making`). Whole is what has
the sizes that the journal tells; a document that it does not know is read. A failure is left
alone under the same rule, unless it is to be tried again. All else is done again.
"""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Mapping
from dataclasses import replace
from os.path import normpath
from pathlib import Path

from PIL import Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import OutputPaths, write_atomic
from cadpose.annotations.parts import plain_text
from cadpose.batch.failures import forget_failure, read_failure
from cadpose.batch.journal import Journal
from cadpose.batch.making import Making
from cadpose.batch.outcome import PhotoOutcome, Task, read_document
from cadpose.batch.outputs import thumbnail_of
from cadpose.batch.photo_files import file_mark, photo_digest
from cadpose.batch.record import PhotoRecord, record_of
from cadpose.errors import CadposeError

log = logging.getLogger(__name__)


class Earlier:
    """The photos that an output folder holds already.

    Args:
        records: The folder's journal.
    """

    def __init__(self, records: Mapping[str, PhotoRecord]) -> None:
        self._records = records

    def belongs_to_another(self, photo: Path, json: Path) -> bool:
        """Whether the document there tells of a photo of another name and of other bytes."""
        stem = json.name.removesuffix(".json")
        record = self._records.get(stem)
        if record is not None and record.output_bytes[:1] == (file_mark(json)[0],):
            name, sha256 = record.photo, record.sha256
        else:
            document = read_document(json)
            if document is None:
                return False
            name, sha256 = document.photo.name, document.photo.sha256
        return normpath(name) != normpath(plain_text(str(photo))) and sha256 != photo_digest(photo)

    def record(self, paths: OutputPaths) -> PhotoRecord | None:
        """The journal's record of a photo whose files are all as large as it says; else None."""
        record = self._records.get(paths.stem)
        if record is None or record.output_bytes != output_bytes(paths):
            return None
        return record

    def knows(self, paths: OutputPaths) -> bool:
        """Whether the journal tells of the photo, whatever has become of its files."""
        return paths.stem in self._records


class Resume:
    """What is left alone of an earlier run, and why the rest is not.

    Args:
        earlier: What the folder holds.
        making: What photos would be made with now.
        journal: Gets the records of documents that it lacks.
        retry_failed: Try those that failed once more.
    """

    def __init__(
        self, earlier: Earlier, making: Making, journal: Journal, *, retry_failed: bool = False
    ) -> None:
        self.earlier, self.making, self.journal = earlier, making, journal
        self.retry_failed = retry_failed
        self._again: Counter[str] = Counter()

    def outcome(self, photo: Path, paths: OutputPaths) -> PhotoOutcome | None:
        """What is left alone; None where the photo is to be annotated."""
        known = self.earlier.knows(paths)
        record = self.earlier.record(paths) if known else self._from_document(photo, paths)
        same = record is not None and _same_bytes(photo, record)
        if record is not None and same and record.made_with == self.making.key:
            forget_failure(paths)
            return PhotoOutcome(photo, paths, record, resumed=True)
        failure = None if self.retry_failed else read_failure(paths.failed)
        if (
            failure is not None
            and failure.made_with == self.making.key
            and failure.sha256 == photo_digest(photo)
        ):
            return PhotoOutcome(photo, paths, error=failure.reason, stage=failure.stage, resumed=True)
        if record is not None:
            self._again["other options" if same else "other bytes"] += 1
        return None

    def tell(self) -> None:
        """Log how many finished photos are made again, and why."""
        for reason, count in self._again.items():
            why = {
                "other options": "were made with other options, another library or another version",
                "other bytes": "have changed since",
            }[reason]
            log.warning("%d finished photos %s: made again", count, why)

    def _from_document(self, photo: Path, paths: OutputPaths) -> PhotoRecord | None:
        """The record of a whole document that the journal does not know; the journal gets it."""
        document = read_document(paths.json)
        if document is None or not all(_ends_well(path) for path in paths.pictures()[:-1]):
            return None
        # Folders of earlier versions have no thumbnails.
        if not paths.thumbnail.is_file() and not _make_thumbnail(paths):
            return None
        made_with = self.making.key if self.making.made(document) else ""
        mark = file_mark(photo)
        record = record_of(
            document,
            made_with=made_with,
            seconds=_seconds(document),
            file=mark if photo_digest(photo) == document.photo.sha256 else (0, 0),
            output_bytes=output_bytes(paths),
        )
        try:
            self.journal.append(paths.stem, record)
        except CadposeError as error:
            log.debug("%s", error)
        return record


def finished(task: Task, making: Making, *, failed: bool = False) -> PhotoOutcome | None:
    """The outcome of a photo that was done before its worker died, without having said so; else None.

    With ``failed`` a failure counts as done too.
    """
    journal = Journal(task.paths.json.parent)
    resume = Resume(Earlier(journal.records()), making, journal, retry_failed=not failed)
    outcome = resume.outcome(task.photo, task.paths)
    return None if outcome is None else replace(outcome, resumed=False)


def output_bytes(paths: OutputPaths) -> tuple[int, ...]:
    """Size of the document, then of each picture; 0 where there is no file."""
    return tuple(file_mark(path)[0] for path in paths.results())


def _ends_well(path: Path) -> bool:
    """Whether a picture or page is there and was not cut short."""
    end = b"</html>\n" if path.suffix == ".html" else b"IEND\xaeB`\x82"
    try:
        with path.open("rb") as file:
            file.seek(-len(end), os.SEEK_END)
            return file.read() == end
    except OSError:
        return False


def _make_thumbnail(paths: OutputPaths) -> bool:
    """Make it of the overlay; whether that could be done."""
    try:
        with Image.open(paths.overlay, formats=["PNG"]) as overlay:
            write_atomic(paths.thumbnail, thumbnail_of(overlay))
    except (OSError, ValueError, CadposeError) as error:
        log.debug("%s: %s", paths.overlay, error)
        return False
    return True


def _same_bytes(photo: Path, record: PhotoRecord) -> bool:
    mark = file_mark(photo)
    if mark == (record.file_bytes, record.file_mtime_ns) and mark[0]:
        return True
    return photo_digest(photo) == record.sha256


def _seconds(document: AnnotationDocument) -> dict[str, float]:
    told: Counter[str] = Counter()
    for part in document.annotations:
        told.update(part.seconds)
    return dict(told)
