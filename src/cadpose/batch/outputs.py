"""The files of one photo: document, overlay, candidate strip and card."""

from __future__ import annotations

import contextlib

from PIL import Image

from cadpose.annotations.card import card_html
from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.files import OutputPaths, write_atomic
from cadpose.annotations.overlay import draw_overlay, overlay_cameras
from cadpose.annotations.strip import LIMIT, draw_strips
from cadpose.annotations.style import png_bytes
from cadpose.pipeline import Annotator, PhotoResult
from cadpose.records import Annotation, Views


def write_outputs(
    annotator: Annotator, result: PhotoResult, paths: OutputPaths
) -> tuple[AnnotationDocument, Image.Image]:
    """Draw and write everything of one photo; the document comes last, so that its presence means done.

    Returns:
        The document and the overlay.

    Raises:
        CadposeError: a file cannot be written.
    """
    document = document_from(result.photo, result.annotations, result.failures)
    overlay = draw_overlay(result.photo, [(a, _over_photo(annotator, a)) for a in result.annotations])
    strips = [_candidates(annotator, a) for a in result.annotations]
    strip = draw_strips(result.photo, list(zip(result.annotations, strips, strict=True)))
    card = card_html(result.photo, document, overlay, strips)
    # A document of an earlier run must not vouch for files of this one.
    with contextlib.suppress(OSError):
        paths.json.unlink()
    write_atomic(paths.overlay, png_bytes(overlay))
    write_atomic(paths.candidates, png_bytes(strip))
    write_atomic(paths.card, card.encode())
    write_atomic(paths.json, document.to_json().encode())
    return document, overlay


def _over_photo(annotator: Annotator, annotation: Annotation) -> Views:
    return annotator.renderer.render(annotator.library.mesh(annotation.cad), overlay_cameras(annotation))


def _candidates(annotator: Annotator, annotation: Annotation) -> Views:
    return Views.joined(
        [
            annotator.render_framed(candidate.cad, candidate.rotation.to_matrix()[None])
            for candidate in annotation.candidates[:LIMIT]
        ]
    )
