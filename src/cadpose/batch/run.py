"""Annotate many photos, one after the other; a photo that fails is recorded and the others go on."""

from __future__ import annotations

import hashlib
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image

from cadpose.annotations.card import GalleryEntry, gallery_entry, index_html
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import OutputPaths, output_paths, write_atomic
from cadpose.annotations.store import Store
from cadpose.batch.outputs import write_outputs
from cadpose.errors import CadposeError, InputError
from cadpose.photos import read_photo
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo

#: Objects of a photo that are known from outside.
DetectionsOf = Callable[[Photo], list[Detection]]


@dataclass(frozen=True, eq=False)
class PhotoOutcome:
    """What came of one photo of a run.

    Attributes:
        photo: Its path.
        document: What was found; None where the photo failed.
        paths: Where its outputs lie.
        error: Why it failed.
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
        CadposeError: ``out`` or the store cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{out}: cannot be made ({error.strerror}), choose another --out") from error
    entries: list[GalleryEntry] = []
    for photo, paths in zip(photos, output_paths(photos, out), strict=True):
        outcome = _finished(photo, paths) if resume else None
        if outcome is None:
            outcome = _annotate(annotator, photo, paths, detections)
        if outcome.document is not None:
            if store is not None:
                store.add(outcome.document)
            overlay = Image.open(io.BytesIO(paths.overlay.read_bytes()))
            entries.append(gallery_entry(outcome.document, paths.card.name, overlay))
        yield outcome
    write_atomic(out / "index.html", index_html(entries).encode())


def _annotate(
    annotator: Annotator, photo: Path, paths: OutputPaths, detections: DetectionsOf | None
) -> PhotoOutcome:
    try:
        picture = read_photo(photo)
        result = annotator.run(picture, None if detections is None else detections(picture))
        document = write_outputs(annotator, result, paths)
    except CadposeError as error:
        return PhotoOutcome(photo, None, paths, str(error))
    return PhotoOutcome(photo, document, paths, seconds=result.seconds)


def _finished(photo: Path, paths: OutputPaths) -> PhotoOutcome | None:
    """The outcome of an earlier run if its document was made from these very bytes."""
    try:
        document = AnnotationDocument.from_json(paths.json.read_text(encoding="utf-8"), str(paths.json))
        with photo.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, InputError, UnicodeDecodeError):
        return None
    whole = all(path.is_file() for path in (paths.overlay, paths.candidates, paths.card))
    return (
        PhotoOutcome(photo, document, paths, resumed=True)
        if whole and document.photo.sha256 == digest
        else None
    )
