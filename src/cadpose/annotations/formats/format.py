"""What a format is: a name, a writer, and a reader."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.sources import Sources


@dataclass(frozen=True, slots=True)
class Format:
    """A format of other tools.

    Attributes:
        name: As the command line calls it.
        what: One line for its help.
        folder: Whether an export is a folder; else it is a file.
        write: Writes documents, which come one at a time, to a new file or into an empty folder.
        read: Reads what ``write`` wrote, also after other tools changed it, one document at a time; None
            where the format cannot be read back.
    """

    name: str
    what: str
    folder: bool
    write: Callable[[Iterable[AnnotationDocument], Path, Sources], None]
    read: Callable[[Path], Iterator[AnnotationDocument]] | None = None
