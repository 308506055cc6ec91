"""Detect the objects of many photos; a photo that fails is recorded and the others go on."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from cadpose.annotations.boxes import draw_detections
from cadpose.annotations.detections_page import FoundEntry, found_entry, found_html
from cadpose.annotations.files import output_paths, spare_photos, write_atomic
from cadpose.annotations.style import png_bytes
from cadpose.detection import Detector
from cadpose.detection.coco_writing import CocoWriter
from cadpose.detection.flags import flagged
from cadpose.detection.masks import MaskEstimator
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.photos import read_photo
from cadpose.records import Detection, Photo

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PhotoDetections:
    """What was found in one photo of a run.

    Attributes:
        photo: Its path.
        detections: Best first, with flags, and masks where they were asked for.
        picture: Where it was drawn, None where it was not.
        error: Why the photo failed, in one sentence that names it; empty where it did not.
    """

    photo: Path
    detections: tuple[Detection, ...] = ()
    picture: Path | None = None
    error: str = ""


def detect_photos(
    detector: Detector,
    masks: MaskEstimator | None,
    photos: Sequence[Path],
    *,
    out: Path | None = None,
    coco: Path | None = None,
) -> Iterator[PhotoDetections]:
    """Find the objects of photos, draw them, and write them as COCO JSON.

    Args:
        detector: What finds them.
        masks: What finds an object's pixels where the detector gives none; None leaves them unknown.
        photos: Their paths.
        out: Folder of the pictures and their index page.
        coco: File of the detections of all photos that did not fail.

    Yields:
        One a photo, in order. COCO file and index page are written at the end, also of a run that is stopped,
        but not where no photo was done: what an earlier run left stays.

    Raises:
        DependencyError: weights or packages are missing that every photo needs.
        CadposeError: an output cannot be written or would replace a photo.
    """
    pictures = [p.json.with_suffix(".detections.png") for p in output_paths(photos, out or Path())]
    targets = [] if out is None else [*pictures, out / "index.html"]
    spare_photos([*targets, *([] if coco is None else [coco])], photos)
    if out is not None:
        try:
            out.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{out}: cannot be made ({error.strerror}), choose another --out") from error
    entries: list[FoundEntry] = []
    writer = CocoWriter()
    done = False
    try:
        for path, picture in zip(photos, pictures, strict=True):
            try:
                photo = read_photo(path)
                found = found_in(photo, detector, masks)
                if out is not None:
                    image = draw_detections(photo, found)
                    write_atomic(picture, png_bytes(image))
                    entries.append(found_entry(path, picture, image, found))
            except DependencyError:
                raise
            except CadposeError as error:
                reason = str(error)
            except Exception as error:  # whatever one photo brings to light, the others go on
                log.debug("%s", path, exc_info=True)
                reason = f"cannot be looked at ({type(error).__name__}: {error}), --verbose tells more"
            else:
                done = True
                writer.add(str(path), photo.width, photo.height, found)
                yield PhotoDetections(path, tuple(found), None if out is None else picture)
                continue
            yield PhotoDetections(path, error=reason if str(path) in reason else f"{path}: {reason}")
    except BaseException:  # stopped, too
        if done:
            for failure in _written(writer, coco, entries, out):
                log.warning("%s", failure)  # what ended the run is what is raised
        raise
    failures = _written(writer, coco, entries, out) if done else []
    for failure in failures[1:]:
        log.warning("%s", failure)
    if failures:
        raise failures[0]


def _written(
    writer: CocoWriter, coco: Path | None, entries: list[FoundEntry], out: Path | None
) -> list[CadposeError]:
    """Write COCO file and index page, each whatever becomes of the other; what could not be written."""
    failures = []
    if coco is not None:
        try:
            write_atomic(coco, writer.to_json(), "--coco")
        except CadposeError as error:
            failures.append(error)
    if out is not None:
        try:
            write_atomic(out / "index.html", found_html(entries).encode())
        except CadposeError as error:
            failures.append(error)
    return failures


def found_in(photo: Photo, detector: Detector, masks: MaskEstimator | None) -> list[Detection]:
    """The objects of one photo with their flags, and with masks where ``masks`` is given."""
    found = [flagged(d, photo.width, photo.height) for d in detector.detect(photo)]
    if masks is None:
        return found
    return [d if d.mask is not None else replace(d, mask=masks.mask(photo, d.box)) for d in found]
