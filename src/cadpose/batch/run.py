"""Annotate many photos, one after the other; a photo that fails is recorded and the others go on."""

from __future__ import annotations

import hashlib
import io
import logging
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from os.path import normpath
from pathlib import Path

from PIL import Image

from cadpose.annotations.card import GalleryEntry, gallery_entry, index_html
from cadpose.annotations.document import MAX_CHARACTERS, AnnotationDocument
from cadpose.annotations.files import OutputPaths, output_paths, spare_photos, write_atomic
from cadpose.annotations.parts import plain_text
from cadpose.annotations.store import Store
from cadpose.batch.outputs import write_outputs
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.photos import read_photo
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo

log = logging.getLogger(__name__)

#: Objects of a photo that are known from outside.
DetectionsOf = Callable[[Photo], list[Detection]]

#: A file that a killed run left behind is swept away once it is this old; a younger one may be another's.
_LEFT_BEHIND_SECONDS = 3600.0


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """What came of one photo of a run.

    Attributes:
        photo: Its path.
        document: What was found; None where the photo failed.
        paths: Where its outputs lie.
        error: Why it failed, in one sentence that names it.
        resumed: The outputs were there already.
        seconds: Time by stage.
    """

    photo: Path
    document: AnnotationDocument | None
    paths: OutputPaths
    error: str = ""
    resumed: bool = False
    seconds: dict[str, float] | None = None


def annotate_photos(
    annotator: Annotator,
    photos: Sequence[Path],
    out: Path,
    *,
    detections: DetectionsOf | None = None,
    store: Store | None = None,
    resume: bool = False,
) -> Iterator[PhotoOutcome]:
    """Annotate photos and write their outputs and an index page to ``out``.

    Outputs are written whole: a run that is killed leaves whole files and at most one hidden ``.part``
    file, which a later run sweeps away. The index page is written at the end, also of a run that is
    stopped, and lists what was done.

    Args:
        annotator: The annotator.
        photos: Their paths.
        out: Folder of the outputs; made when needed.
        detections: Gives the objects of a photo instead of the detector.
        store: Also keeps the documents there, one transaction a photo.
        resume: Leave photos alone whose document in ``out`` was made from the same bytes.

    Yields:
        One outcome a photo, in order, as soon as it is written.

    Raises:
        DependencyError: weights or programs are missing that every photo needs.
        CadposeError: ``out`` or the store cannot be written, or an output would replace a photo.
    """
    planned = output_paths(photos, out, _belongs_to_another)
    spare_photos([out / "index.html", *(path for paths in planned for path in paths.all())], photos)
    try:
        out.mkdir(parents=True, exist_ok=True)
        _sweep(out)
    except OSError as error:
        raise InputError(f"{out}: cannot be made ({error.strerror}), choose another --out") from error
    entries: list[GalleryEntry] = []
    try:
        for photo, paths in zip(photos, planned, strict=True):
            done = _finished(photo, paths) if resume else None
            outcome, overlay = done or _annotate(annotator, photo, paths, detections)
            if outcome.document is not None and overlay is not None:
                if store is not None:
                    store.add(outcome.document)
                entries.append(gallery_entry(outcome.document, paths.card.name, overlay))
            yield outcome
    finally:
        write_atomic(out / "index.html", index_html(entries).encode())


def _annotate(
    annotator: Annotator, photo: Path, paths: OutputPaths, detections: DetectionsOf | None
) -> tuple[PhotoOutcome, Image.Image | None]:
    try:
        picture = read_photo(photo)
        result = annotator.run(picture, None if detections is None else detections(picture))
        document, overlay = write_outputs(annotator, result, paths)
    except DependencyError:
        raise
    except CadposeError as error:
        reason = str(error)
    except Exception as error:  # whatever one photo brings to light, the others go on
        log.debug("%s", photo, exc_info=True)
        reason = f"cannot be annotated ({type(error).__name__}: {error}), --verbose tells more"
    else:
        return PhotoOutcome(photo, document, paths, seconds=result.seconds), overlay
    return PhotoOutcome(photo, None, paths, reason if str(photo) in reason else f"{photo}: {reason}"), None


def _finished(photo: Path, paths: OutputPaths) -> tuple[PhotoOutcome, Image.Image] | None:
    """The outcome of an earlier run, with its overlay, if its document was made from these very bytes."""
    document = _document(paths.json)
    if document is None or document.photo.sha256 != _digest(photo):
        return None
    try:
        overlay = Image.open(io.BytesIO(paths.overlay.read_bytes())).convert("RGB")
    except OSError:
        return None
    if not all(path.is_file() for path in (paths.candidates, paths.card)):
        return None
    return PhotoOutcome(photo, document, paths, resumed=True), overlay


def _belongs_to_another(photo: Path, path: Path) -> bool:
    """Whether the document there tells of a photo of another name and of other bytes."""
    document = _document(path)
    if document is None or normpath(document.photo.name) == normpath(plain_text(str(photo))):
        return False
    return document.photo.sha256 != _digest(photo)


def _document(path: Path) -> AnnotationDocument | None:
    """The document there; None where there is none, or none that can be used."""
    try:
        with path.open(encoding="utf-8") as file:
            return AnnotationDocument.from_json(file.read(MAX_CHARACTERS + 1), str(path))
    except (OSError, InputError, UnicodeDecodeError):
        return None


def _digest(photo: Path) -> str:
    """SHA-256 of a photo's bytes; empty where they cannot be read."""
    try:
        # A pipe or a device would never end.
        if not photo.is_file():
            return ""
        with photo.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError:
        return ""


def _sweep(out: Path) -> None:
    for part in out.glob(".cadpose-*.part"):
        if time.time() - part.stat().st_mtime > _LEFT_BEHIND_SECONDS:
            part.unlink(missing_ok=True)
