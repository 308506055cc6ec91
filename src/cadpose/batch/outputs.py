"""The pictures of one photo: overlay, candidate strip, card and thumbnail."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from PIL import Image

from cadpose.annotations.card import card_html
from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.files import OutputPaths, sync_folder, told_as_unwritten, write_beside
from cadpose.annotations.overlay import draw_overlay, overlay_cameras
from cadpose.annotations.strip import LIMIT, draw_strips
from cadpose.annotations.style import jpeg_bytes, png_bytes
from cadpose.pipeline import Annotator, PhotoResult
from cadpose.records import Annotation, Views

#: Longest sides of a thumbnail, in pixels.
_THUMBNAIL = (320, 240)


@dataclass(frozen=True)
class Drawn:
    """Everything that is written of one photo.

    Attributes:
        document: What was found.
        json: The document as the bytes of its file.
        pictures: The bytes of overlay, strip, card and thumbnail, in the order of ``OutputPaths.pictures``.
    """

    document: AnnotationDocument
    json: bytes
    pictures: tuple[bytes, ...]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Bytes of the document, then of each picture."""
        return len(self.json), *(len(data) for data in self.pictures)

    @contextmanager
    def beside(self, paths: OutputPaths) -> Iterator[Callable[[], None]]:
        """Write all files beside their places; what is handed out moves them there.

        What an earlier run left stays until then. In the end no file is left beside its place.

        Raises:
            CadposeError: a file cannot be written, or moved.
        """
        waiting: dict[Path, Path] = {}
        try:
            for path, data in zip(paths.results(), (self.json, *self.pictures), strict=True):
                waiting[path] = write_beside(path, data)
            yield partial(_move, waiting, paths)
        finally:
            for part in waiting.values():
                with suppress(OSError):
                    part.unlink(missing_ok=True)


def _move(waiting: Mapping[Path, Path], paths: OutputPaths) -> None:
    """Move files into place, the document last: its presence says that the photo is done."""
    with told_as_unwritten(paths.json):
        # A document of an earlier run must not vouch for files of this one, nor after a power cut.
        if paths.json.exists():
            paths.json.unlink()
            sync_folder(paths.json.parent)
        for path in paths.pictures():
            waiting[path].replace(path)
        for folder in dict.fromkeys(path.parent for path in paths.pictures()):
            sync_folder(folder)
        waiting[paths.json].replace(paths.json)
        sync_folder(paths.json.parent)


def draw_outputs(annotator: Annotator, result: PhotoResult) -> Drawn:
    """Draw everything of one photo."""
    document = document_from(result.photo, result.annotations, result.failures)
    overlay = draw_overlay(result.photo, [(a, _over_photo(annotator, a)) for a in result.annotations])
    strips = [_candidates(annotator, a) for a in result.annotations]
    strip = draw_strips(result.photo, list(zip(result.annotations, strips, strict=True)))
    card = card_html(result.photo, document, overlay, strips)
    return Drawn(
        document,
        document.to_json().encode(),
        (png_bytes(overlay), png_bytes(strip), card.encode(), thumbnail_of(overlay)),
    )


def thumbnail_of(overlay: Image.Image) -> bytes:
    """The overlay as a small JPEG."""
    small = overlay.convert("RGB")
    small.thumbnail(_THUMBNAIL, Image.Resampling.LANCZOS)
    return jpeg_bytes(small, quality=75)


def _over_photo(annotator: Annotator, annotation: Annotation) -> Views:
    return annotator.renderer.render(annotator.library.mesh(annotation.cad), overlay_cameras(annotation))


def _candidates(annotator: Annotator, annotation: Annotation) -> Views:
    return Views.joined(
        [
            annotator.render_framed(candidate.cad, candidate.rotation.to_matrix()[None])
            for candidate in annotation.candidates[:LIMIT]
        ]
    )
