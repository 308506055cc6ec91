"""The published JSON document of one photo, ``cadpose.annotation/1`` (docs/output.md says every field).

Unknown keys, numbers that are not finite, and documents that contradict themselves are refused.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, ValidationError, model_validator

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.parts import DetectionPart, Part, PhotoPart, plain_text
from cadpose.errors import InputError
from cadpose.records import Annotation, Detection, Photo

SCHEMA: Literal["cadpose.annotation/1"] = "cadpose.annotation/1"
#: Longest document that is parsed, in characters.
MAX_CHARACTERS = 64_000_000


@dataclass(frozen=True, eq=False)
class Failure:
    """An object that was detected but not annotated.

    Attributes:
        detection: What was found.
        reason: One sentence.
        stage: Where it ended, for example ``"library"`` or ``"rotation"``.
    """

    detection: Detection
    reason: str
    stage: str = ""


class FailurePart(Part):
    """An object that was detected but not annotated, and why."""

    detection: DetectionPart
    reason: Annotated[str, Field(min_length=1)]
    stage: str


class AnnotationDocument(Part):
    """Everything that was found in one photo."""

    schema_version: Literal["cadpose.annotation/1"] = Field(alias="schema")
    photo: PhotoPart
    annotations: tuple[AnnotationPart, ...]
    failures: tuple[FailurePart, ...]

    @model_validator(mode="after")
    def _masks_fit_the_photo(self) -> Self:
        width, height = self.photo.size
        found = [part.detection for part in self.annotations] + [part.detection for part in self.failures]
        for mask in (detection.mask for detection in found):
            if mask is not None and mask.size != (height, width):
                raise ValueError(f"a mask of {mask.size} does not fit a photo of {width} x {height}")
        return self

    def to_json(self) -> str:
        """Indented JSON, lists of numbers on one line, newline at the end."""
        text = json.dumps(self.model_dump(mode="json", by_alias=True), indent=2, ensure_ascii=False)
        # A raw newline cannot stand inside a JSON string, so only real lists match.
        return re.sub(r"\[\n[\s\d.eE+,-]*\]", lambda m: _one_line(m.group()), text) + "\n"

    @classmethod
    def from_json(cls, text: str, name: str = "the annotation document") -> AnnotationDocument:
        """Parse and check a document.

        Args:
            text: JSON.
            name: What to call it in the error, usually its path.

        Raises:
            InputError: not JSON, too long, another schema version, or not valid.
        """
        if len(text) > MAX_CHARACTERS:
            raise InputError(f"{name} is longer than {MAX_CHARACTERS} characters: not a cadpose annotation")
        try:
            return cls.model_validate_json(text)
        except ValidationError as error:
            first, *others = error.errors(include_url=False, include_context=False)
            where = "".join(f"{step}." for step in first["loc"])[:-1]
            # Unknown keys are quoted here, and they are whatever the file's author wrote.
            where = "".join(c if c.isprintable() else "?" for c in where[:120])
            fault = f"{where}: {first['msg']}" if where else first["msg"]
            if first["loc"] == ("schema",) and first["type"] == "literal_error":
                if not re.fullmatch(r"cadpose\.annotation/[0-9]{1,9}", str(first["input"])):
                    raise InputError(
                        f"{name} is no annotation document: its schema is not {SCHEMA}"
                    ) from None
                fault += "; another version of cadpose wrote it, read it with that one"
            more = f" (and {len(others)} more)" if others else ""
            raise InputError(f"{name} is not a valid {SCHEMA} document: {fault}{more}") from None

    @classmethod
    def read(cls, path: Path) -> AnnotationDocument:
        """A document's file.

        Raises:
            InputError: it cannot be read, or as of `from_json`.
        """
        try:
            with path.open(encoding="utf-8") as file:
                text = file.read(MAX_CHARACTERS + 1)
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "not UTF-8"
            raise InputError(
                f"{path} cannot be read ({reason}): name documents of `cadpose annotate`"
            ) from None
        return cls.from_json(text, str(path))

    def to_annotations(self) -> list[Annotation]:
        """The records, exactly as they were handed to ``document_from``."""
        return [part.record(self.photo) for part in self.annotations]

    def to_failures(self) -> list[Failure]:
        """The failures as records."""
        return [Failure(part.detection.record(), part.reason, part.stage) for part in self.failures]


def document_from(
    photo: Photo, annotations: Sequence[Annotation], failures: Sequence[Failure] = ()
) -> AnnotationDocument:
    """The document of one photo.

    A photo without a digest gets that of its pixels.

    Raises:
        ValueError: an annotation belongs to another photo, or holds a number that is not finite
            (pydantic's ValidationError is a ValueError).
    """
    for annotation in annotations:
        if (annotation.photo_sha256, annotation.photo_size) != (photo.sha256, (photo.width, photo.height)):
            raise ValueError(f"an annotation of {annotation.photo_name} was put under {photo.name}")
    return AnnotationDocument(
        schema=SCHEMA,
        photo=PhotoPart(
            name=plain_text(photo.name),
            sha256=photo.sha256 or _pixel_digest(photo),
            size=(photo.width, photo.height),
        ),
        annotations=tuple(AnnotationPart.of(annotation) for annotation in annotations),
        failures=tuple(
            FailurePart(
                detection=DetectionPart.of(failure.detection),
                reason=plain_text(failure.reason),
                stage=plain_text(failure.stage),
            )
            for failure in failures
        ),
    )


def _pixel_digest(photo: Photo) -> str:
    return hashlib.sha256(f"{photo.width}x{photo.height}:".encode() + photo.rgb.tobytes()).hexdigest()


def _one_line(block: str) -> str:
    return "[" + ", ".join(block[1:-1].replace(",", " ").split()) + "]"
