"""What is to be done for one photo of a run, and what came of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from cadpose.annotations.document import MAX_CHARACTERS, AnnotationDocument
from cadpose.annotations.files import OutputPaths
from cadpose.batch.record import PhotoRecord
from cadpose.errors import InputError


@dataclass(frozen=True)
class Task:
    """A photo to annotate.

    Attributes:
        photo: Its path.
        paths: Where its outputs go.
    """

    photo: Path
    paths: OutputPaths


@dataclass(frozen=True)
class PhotoOutcome:
    """What came of one photo of a run.

    Attributes:
        photo: Its path.
        paths: Where its outputs lie.
        record: What was found, in short; None where the photo failed.
        error: Why it failed, in one sentence that names it.
        stage: Where it failed, for example ``"read"`` or ``"worker"``.
        resumed: The outputs, or the failure, were there already.
        same_as: The photo of the run that holds the same bytes and was annotated in its place.
    """

    photo: Path
    paths: OutputPaths
    record: PhotoRecord | None = None
    error: str = ""
    stage: str = ""
    resumed: bool = False
    same_as: Path | None = None

    @property
    def document(self) -> AnnotationDocument | None:
        """The document, read from its file; None where the photo failed or the file has gone."""
        return None if self.record is None else read_document(self.paths.json)

    @property
    def seconds(self) -> dict[str, float]:
        """Time by stage."""
        return {} if self.record is None else dict(self.record.seconds)


def read_document(path: Path) -> AnnotationDocument | None:
    """The document there; None where there is none, or none that can be used."""
    try:
        with path.open(encoding="utf-8") as file:
            return AnnotationDocument.from_json(file.read(MAX_CHARACTERS + 1), str(path))
    except (OSError, InputError, UnicodeDecodeError):
        return None
