"""The journal of an output folder: one line a finished photo, so that nobody has to read its documents.

The documents are what counts. A line is appended, in one write, just before its document is moved into
place: a killed run may leave a line without a document, which vouches for nothing. A line that is lost or
damaged costs time only, as its document is then read.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterator
from pathlib import Path

from pydantic import ValidationError

from cadpose.annotations.files import write_atomic
from cadpose.batch.record import Kept, PhotoRecord
from cadpose.errors import CadposeError

log = logging.getLogger(__name__)

NAME = "journal.jsonl"
#: Longer lines and larger files are not ours.
_LINE_BYTES, _FILE_BYTES = 1 << 20, 1 << 31
#: A journal is written anew once it is this large and mostly out of date.
_WORTH_CLEANING = 1 << 24


class _Line(Kept):
    stem: str
    record: PhotoRecord


class Journal:
    """The journal of one output folder.

    Args:
        folder: The folder, which is there.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME

    def append(self, stem: str, record: PhotoRecord) -> None:
        """Add a photo's line.

        Raises:
            CadposeError: it cannot be written.
        """
        line = _Line(stem=stem, record=record).model_dump_json().encode() + b"\n"
        try:
            # One write to a file opened for appending: lines of several processes do not mix.
            handle = os.open(self.path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
            try:
                if os.write(handle, line) != len(line):
                    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
            finally:
                os.close(handle)
        except OSError as error:
            raise CadposeError(
                f"cannot write {self.path}: {error.strerror}; choose another place with --out"
            ) from None

    def records(self) -> dict[str, PhotoRecord]:
        """The last record of each stem; lines that cannot be read are passed over."""
        return dict(self._lines())

    def tidy(self) -> None:
        """Before a run: end a line that was cut short, and drop what is out of date where it is much.

        Lines that another run of the same folder appends meanwhile may be lost.
        """
        try:
            size = self.path.stat().st_size
            if size == 0:
                return
            with self.path.open("r+b") as file:
                file.seek(-1, os.SEEK_END)
                if file.read(1) != b"\n":
                    file.write(b"\n")
        except OSError:
            return  # there is none yet, or it cannot be written, which the first line will tell
        if size < _WORTH_CLEANING:
            return
        count, found = 0, {}
        for stem, record in self._lines():
            found[stem], count = record, count + 1
        if count > 4 * len(found):
            kept = (_Line(stem=stem, record=record).model_dump_json() for stem, record in found.items())
            write_atomic(self.path, "".join(f"{line}\n" for line in kept).encode())

    def _lines(self) -> Iterator[tuple[str, PhotoRecord]]:
        try:
            if self.path.stat().st_size > _FILE_BYTES:
                log.warning("%s is too large to be used: delete it, the documents will be read", self.path)
                return
            with self.path.open("rb") as file:
                while text := file.readline(_LINE_BYTES):
                    try:
                        line = _Line.model_validate_json(text)
                    except ValidationError:
                        continue  # cut short by a kill, or not ours
                    yield line.stem, line.record
        except OSError:
            return
