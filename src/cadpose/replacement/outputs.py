"""The files of one replacement, and the document that says what stood there."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.style import png_bytes
from cadpose.errors import InputError
from cadpose.records import Annotation, Photo


@dataclass(frozen=True, slots=True)
class OutputFiles:
    """Where everything goes.

    Attributes:
        picture: The finished picture.
        sheet: Before and after.
        scene: The glTF scene, if wanted.
        background: The photo without the object, if wanted.
    """

    picture: Path
    sheet: Path
    scene: Path | None
    background: Path | None

    @property
    def by_kind(self) -> dict[str, Path]:
        """Those that are written, by what they are."""
        told = {
            "picture": self.picture,
            "sheet": self.sheet,
            "scene": self.scene,
            "background": self.background,
        }
        return {kind: path for kind, path in told.items() if path is not None}

    @property
    def all(self) -> tuple[Path, ...]:
        """Those that are written."""
        return tuple(self.by_kind.values())


def output_files(photo: Path, out: Path | None, scene: Path | None, background: Path | None) -> OutputFiles:
    """Where the outputs for a photo go.

    Raises:
        InputError: a file has another ending than its format, or two have one place.
    """
    picture = out or Path("runs/replace") / f"{photo.stem}.png"
    endings = ((picture, ".png", "--out"), (scene, ".glb", "--scene"), (background, ".png", "--background"))
    for path, ending, option in endings:
        if path is not None and path.suffix.lower() != ending:
            raise InputError(f"{path} must end in {ending}: choose another {option}")
    files = OutputFiles(picture, picture.with_suffix(".sheet.png"), scene, background)
    if len(set(files.all)) < len(files.all):
        raise InputError(f"{background} would be written over by another output: choose another --background")
    return files


def picture_png(rgb: NDArray[np.uint8]) -> bytes:
    """PNG of (H, W, 3) pixels and nothing else: a photo's EXIF is of a picture that this one no longer is."""
    return png_bytes(Image.fromarray(np.ascontiguousarray(rgb)))


def annotations_of(document: Path, photo: Photo) -> list[Annotation]:
    """The annotations that a document holds of a photo.

    Raises:
        InputError: the document cannot be read or is of another photo.
    """
    told = AnnotationDocument.read(document)
    if told.photo.size != (photo.width, photo.height) or told.photo.sha256 != photo.sha256:
        raise InputError(
            f"{document} is of {told.photo.name}, not of {photo.name}: name its own photo, or annotate again"
        )
    return told.to_annotations()
