"""Failures of whole photos, kept beside the outputs as ``NAME.failed.json`` so that --resume knows them."""

from __future__ import annotations

import contextlib
import json
import logging
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError

from cadpose.annotations.files import OutputPaths, write_atomic
from cadpose.annotations.parts import plain_text
from cadpose.annotations.store import Store
from cadpose.batch.outcome import PhotoOutcome
from cadpose.batch.photo_files import photo_digest
from cadpose.batch.record import Kept
from cadpose.errors import CadposeError

log = logging.getLogger(__name__)

SCHEMA: Literal["cadpose.failure/1"] = "cadpose.failure/1"
_MOST_BYTES = 1 << 20


class PhotoFailure(Kept):
    """Why a photo failed.

    Attributes:
        photo: Its path as it was named.
        sha256: Of its bytes; empty where they could not be read.
        stage: Where it failed.
        reason: One sentence that names the photo.
        made_with: Key of what it was tried with, see :mod:`cadpose.batch.making`.
    """

    schema_version: Literal["cadpose.failure/1"] = Field(alias="schema")
    photo: str
    sha256: Annotated[str, Field(pattern=r"^([0-9a-f]{64})?$")]
    stage: str
    reason: Annotated[str, Field(min_length=1)]
    made_with: str


def record_failure(
    photo: Path, paths: OutputPaths, stage: str, reason: str, made_with: str, store: Store | None
) -> PhotoOutcome:
    """Write a photo's failure to its file and to the store; what came of an earlier try stays.

    The file is left out where it cannot be written: the run goes on, and --resume tries the photo again.

    Raises:
        CadposeError: the store cannot be written.
    """
    reason = reason if str(photo) in reason else f"{photo}: {reason}"
    failure = PhotoFailure(
        schema=SCHEMA,
        photo=plain_text(str(photo)),
        sha256=photo_digest(photo),
        stage=stage,
        reason=plain_text(reason),
        made_with=made_with,
    )
    text = json.dumps(failure.model_dump(mode="json", by_alias=True), indent=2, ensure_ascii=False)
    try:
        write_atomic(paths.failed, f"{text}\n".encode())
    except CadposeError as error:
        log.debug("%s", error)
    if store is not None:
        store.add_failure(failure.photo, failure.sha256 or None, stage, failure.reason)
    return PhotoOutcome(photo, paths, error=reason, stage=stage)


def read_failure(path: Path) -> PhotoFailure | None:
    """The failure there; None where there is none, or none that can be used."""
    try:
        with path.open("rb") as file:
            return PhotoFailure.model_validate_json(file.read(_MOST_BYTES))
    except (OSError, ValidationError):
        return None


def forget_failure(paths: OutputPaths) -> None:
    """The photo is done: an earlier failure is past."""
    with contextlib.suppress(OSError):
        paths.failed.unlink(missing_ok=True)
