"""Annotated photos on disk, with the models of the small library."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.formats.registry import documents_from, export
from cadpose.annotations.formats.sources import Sources
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation, Candidate, Photo, Pose4Dof, Rotation
from tests.annotations.factory import make_annotation, make_failure, make_photo
from tests.small_library import save


@dataclass(frozen=True, eq=False)
class Made:
    """Documents with their photos and library."""

    documents: tuple[AnnotationDocument, ...]
    folder: Path
    library: Library

    @property
    def sources(self) -> Sources:
        return Sources(self.library.path, self.folder)

    def export(self, name: str, out: Path, **options: Any) -> Path:
        export(name, self.documents, out, options.pop("sources", self.sources), **options)
        return out

    def again(self, name: str, out: Path) -> list[AnnotationDocument]:
        """What comes back of an export."""
        return list(documents_from(name, self.export(name, out)))


def make(folder: Path, library: Library) -> Made:
    """Four photos: two objects and a failure, one object, one object, none; two share a file name."""
    street = _photo(folder, "a/street.png", "a/street.png")
    other = _photo(folder, "b/street.png", "b/street.png", 90, 61)
    hostile = _photo(folder, "../../e vil;$(x).png", "e vil;$(x).png", 64, 48)
    empty = _photo(folder, "a/empty.png", "a/empty.png", 30, 40)
    ids = [model.id for model in library.models("car")]
    first = _of(make_annotation(street, box=Box(5.0, 4.0, 60.1, 50.5)), library, ids[:2])
    second = _of(make_annotation(street, box=Box(12.3, 4.0, 67.0, 50.5), **_plain()), library, ids[1:2])
    second = replace(second, detection=replace(second.detection, mask=None), mask_iou=None)
    blot = np.zeros((61, 90), np.bool_)
    blot[3:40, 1:50] = True
    blot[55:, 80:] = True  # beyond the box
    third = _of(make_annotation(other, box=Box(1.25, 2.5, 50.75, 41.0)), library, ids[2:])
    third = replace(third, detection=replace(third.detection, mask=blot, category="chair"))
    turned = Pose4Dof(Rotation(271.25, -33.3, 179.5), 77.125, (20.0625, 71.9))
    fourth = replace(_of(make_annotation(hostile, box=Box(0.0, 0.0, 64.0, 48.0)), library, ids), pose=turned)
    documents = (
        document_from(street, [first, second], [make_failure()]),
        document_from(other, [third]),
        document_from(hostile, [replace(fourth, pose_6dof=None, verdict="reject")]),
        document_from(empty, []),
    )
    return Made(documents, folder, library)


def _plain() -> dict[str, Any]:
    return {"refinement": None, "pose_6dof": None, "confidence": None, "verdict": None, "hypotheses": ()}


def _photo(folder: Path, name: str, file: str, width: int = 120, height: int = 80) -> Photo:
    path = save(folder / file, make_photo(name, width, height).rgb)
    return replace(read_photo(path), name=name)


def _of(annotation: Annotation, library: Library, ids: Sequence[str]) -> Annotation:
    candidates = tuple(
        Candidate(library.get(key), 0.9 - i / 8, annotation.pose.rotation, {"sm2": 1.0 / 3.0}, 0.5 / (i + 1))
        for i, key in enumerate(ids)
    )
    return replace(annotation, candidates=candidates)
