"""What both formats put into a scene: the layout, each CAD model's pieces once, and the photo as JPEG."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from PIL import Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.scenes.layout import Layout, Placement, lay_out
from cadpose.annotations.scenes.pieces import Piece, pieces_of
from cadpose.errors import InputError
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel, Photo

#: Longest side of the backdrop's picture: what every graphics driver takes. Its place is not rounded.
MAX_BACKDROP = 4096


class Meshes(Protocol):
    """Where meshes come from; `cadpose.library.catalogue.Library` is one."""

    def get(self, cad_id: str) -> CadModel:
        """The model of that id."""

    def mesh(self, cad: CadModel | str) -> Mesh:
        """Its mesh, in ShapeNet axes with a diagonal of 1."""


@dataclass(frozen=True, eq=False)
class SceneContents:
    """Everything that a writer needs.

    Attributes:
        document: The photo's annotations.
        layout: Where things stand.
        pieces: Each CAD model's pieces by its id.
        photo_jpeg: The photo, at most `MAX_BACKDROP` a side.
    """

    document: AnnotationDocument
    layout: Layout
    pieces: dict[str, list[Piece]]
    photo_jpeg: bytes


def gather(
    document: AnnotationDocument, library: Meshes, photo: Photo, placement: Placement, *, centred: bool
) -> SceneContents:
    """Lay a photo's scene out and fetch its meshes.

    Raises:
        InputError: the photo or a library's model is not the one that was annotated, or an annotation
            cannot be placed.
        LibraryError: a model is not in the library, or its file is damaged.
    """
    told = document.photo
    if (photo.width, photo.height) != told.size or (photo.sha256 and photo.sha256 != told.sha256):
        raise InputError(f"{photo.name} is not the photo that was annotated as {told.name}")
    annotations = document.to_annotations()
    pieces: dict[str, list[Piece]] = {}
    for cad in (annotation.cad for annotation in annotations):
        if cad.id in pieces:
            continue
        if cad.sha256 and library.get(cad.id).sha256 != cad.sha256:
            raise InputError(
                f"the library's model {cad.id} is not the one that was annotated in {told.name}: "
                "name the library of that run, or annotate again"
            )
        pieces[cad.id] = pieces_of(library.mesh(cad.id))
    layout = lay_out(annotations, photo, placement=placement, centred=centred)
    return SceneContents(document, layout, pieces, _jpeg(photo))


def _jpeg(photo: Photo) -> bytes:
    image = Image.fromarray(np.ascontiguousarray(photo.rgb))
    image.thumbnail((MAX_BACKDROP, MAX_BACKDROP), Image.Resampling.LANCZOS)
    out = io.BytesIO()
    image.save(out, "JPEG", quality=92, subsampling=0)
    return out.getvalue()
