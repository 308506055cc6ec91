"""The pictures of one photo: overlay, candidate strip, card and thumbnail."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass

from PIL import Image

from cadpose.annotations.card import card_html
from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.files import OutputPaths, write_atomic
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

    def write_pictures(self, paths: OutputPaths) -> None:
        """Write the pictures; the document that an earlier run left goes first.

        Raises:
            CadposeError: a file cannot be written.
        """
        # A document of an earlier run must not vouch for files of this one.
        with contextlib.suppress(OSError):
            paths.json.unlink()
        for path, data in zip(paths.pictures(), self.pictures, strict=True):
            write_atomic(path, data)

    def write_document(self, paths: OutputPaths) -> None:
        """Write the document: its presence says that the photo is done.

        Raises:
            CadposeError: it cannot be written.
        """
        write_atomic(paths.json, self.json)


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
