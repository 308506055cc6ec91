"""Bringing an import into a store, and telling what it and people's decisions there say differently."""

from __future__ import annotations

import numpy as np

from cadpose.annotations.database.standing import SAME_OBJECT_IOU
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.store import Author, Store, StoredAnnotation
from cadpose.geometry.boxes import box_iou
from cadpose.geometry.frames import FloatArray


def add_imported(store: Store, document: AnnotationDocument, author: Author) -> list[str] | None:
    """Write an imported document; None where it is what the store gives already, people's edits included.

    Args:
        store: Where.
        document: From another tool.
        author: Whose word the verdicts of annotations new to the store are.

    Returns:
        A sentence for every object on which a person's decision no longer holds, or goes on holding although
        the file says something else.

    Raises:
        CadposeError: the store cannot be written.
    """
    sha256 = document.photo.sha256
    held = store.document(sha256)
    if held == document:
        return None
    before = [] if held is None else store.standing(sha256)
    former = set() if held is None else {_key(found) for found in store.former(sha256)}
    if not store.add(document, author):
        return None
    if held is None:
        return []
    known = former | {_key(found) for found in before}
    after = store.standing(sha256)
    holding = {_key(found) for found in after}
    new = [found for found in after if _key(found) not in known]
    return [
        f"{_named(found)}: a person's {found.item.verdict} no longer holds, since the file says otherwise"
        for found in before
        if found.item.decided_by == "human" and _key(found) not in holding and _met(found, new)
    ] + [
        f"{_named(found)}: the file says otherwise, but what a person decided goes on holding"
        for found in store.former(sha256)
        if _key(found) not in known and document.annotations[found.item.position] not in held.annotations
    ]


def _met(found: StoredAnnotation, others: list[StoredAnnotation]) -> bool:
    box = _box(found)
    return any(box_iou(box, _box(other)) >= SAME_OBJECT_IOU for other in others)


def _box(found: StoredAnnotation) -> FloatArray:
    box = found.annotation.detection.box
    return np.array([box.x0, box.y0, box.x1, box.y1])


def _key(found: StoredAnnotation) -> str:
    return found.item.annotation_id


def _named(found: StoredAnnotation) -> str:
    return f"{found.item.photo_name}, {found.item.category} {found.item.position + 1}"
