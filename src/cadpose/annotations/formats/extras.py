"""What a format has no place for: it travels in keys of our own, and comes back from there.

A format's own fields are what other tools show and change, so on import they count, where they differ by more
than rounding from what our keys say.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import SCHEMA, AnnotationDocument, FailurePart
from cadpose.annotations.parts import MaskPart, PhotoPart, PosePart
from cadpose.errors import InputError
from cadpose.geometry.camera import require_rotation
from cadpose.geometry.frames import FloatArray
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rle import MAX_PIXELS

#: By how much a format's own number may differ from the kept one and still be the same, in pixels.
SAME = 1e-6


def extras_of(part: AnnotationPart, mask: bool = False) -> dict[str, Any]:
    """Everything of an annotation, its mask only where that is asked for."""
    told = part.model_dump(mode="json", by_alias=True)
    if not mask:
        del told["detection"]["mask"]
    return told


def photo_extras(document: AnnotationDocument) -> dict[str, Any]:
    """The photo's name, digest and size, and the objects that could not be annotated."""
    return {
        **document.photo.model_dump(mode="json"),
        "failures": [failure.model_dump(mode="json") for failure in document.failures],
    }


@dataclass(frozen=True)
class Native:
    """What a format's own fields say of an object; None where it says nothing.

    Attributes:
        box: x0, y0, x1, y1.
        category: Its class.
        mask: Its mask.
        has_mask: Whether ``mask`` counts: else the kept one does.
        pose: From `native_pose`.
    """

    box: Sequence[float] | None = None
    category: str | None = None
    mask: MaskPart | None = None
    has_mask: bool = False
    pose: PosePart | None = None


def annotation_from(extras: Any, native: Native, where: str) -> AnnotationPart:
    """An annotation from our keys and a format's own.

    Args:
        extras: What `extras_of` gave, perhaps among keys of others.
        native: What the format says itself.
        where: File and place, for the message.

    Raises:
        InputError: our keys are missing or wrong.
    """
    names = AnnotationPart.model_fields
    told = {key: extras[key] for key in names if key in extras} if isinstance(extras, dict) else {}
    if not isinstance(told.get("detection"), dict) or "pose" not in told:
        raise InputError(
            f"{where} has none of the keys that `cadpose export` writes, so it is no annotation of a pose: "
            "read data sets of others with `cadpose dataset convert`, boxes and masks with --detections"
        )
    detection = dict(told["detection"])
    if native.has_mask:
        detection["mask"] = None if native.mask is None else native.mask.model_dump(mode="json")
    else:
        detection.setdefault("mask", None)
    if native.category:
        detection["category"] = native.category
    if native.box is not None and not _same(native.box, detection.get("box")):
        detection["box"] = [float(value) for value in native.box]
    told["detection"] = detection
    if native.pose is not None:
        told["pose"] = native.pose.model_dump(mode="json")
    try:
        # Through JSON text, because in strict mode only there a list stands for a tuple.
        return AnnotationPart.model_validate_json(json.dumps(told))
    except (ValidationError, ValueError) as error:
        raise InputError(f"{where} holds no valid annotation: {told_error(error)}") from None


def document_from_parts(photo: Any, annotations: Sequence[AnnotationPart], where: str) -> AnnotationDocument:
    """The document of a photo.

    Args:
        photo: What `photo_extras` gave; failures may be missing.
        annotations: Its annotations.
        where: File and place, for the message.

    Raises:
        InputError: the photo's keys are missing or wrong, or a mask does not fit it.
    """
    if not isinstance(photo, dict):
        raise InputError(
            f"{where} has none of the keys that `cadpose export` writes, so its photo is unknown"
        )
    try:
        part = PhotoPart.model_validate_json(json.dumps({k: photo.get(k) for k in PhotoPart.model_fields}))
        failures = [FailurePart.model_validate_json(json.dumps(f)) for f in photo.get("failures") or ()]
        return AnnotationDocument(
            schema=SCHEMA, photo=part, annotations=tuple(annotations), failures=tuple(failures)
        )
    except (ValidationError, ValueError, TypeError) as error:
        raise InputError(f"{where} holds no valid annotation: {told_error(error)}") from None


def photo_size(photo: Any, where: str) -> tuple[int, int]:
    """(width, height) as `photo_extras` tells them: masks of that size are made.

    Raises:
        InputError: they are not told, or are more pixels than a mask may have.
    """
    size = photo.get("size") if isinstance(photo, dict) else None
    if not (isinstance(size, list) and len(size) == 2 and all(isinstance(v, int) and v > 0 for v in size)):
        raise InputError(f"{where} does not tell its photo's size: export it again")
    if size[0] * size[1] > MAX_PIXELS:
        raise InputError(f"{where} tells a photo of more than {MAX_PIXELS} pixels: export it again")
    return size[0], size[1]


def native_pose(
    kept: PosePart, R_cv_from_s: FloatArray, t_cv: FloatArray, K: FloatArray, where: str
) -> PosePart:
    """The kept pose where a format's own says the same, else the format's own.

    Args:
        kept: What our keys say.
        R_cv_from_s: (3, 3).
        t_cv: (3,) in model diagonals.
        K: (3, 3).
        where: File and place, for the message.

    Raises:
        InputError: the format's own pose is another one, and none of four degrees of freedom.
    """
    told = np.array([0.0, 0.0, kept.t_z])
    same = (
        np.allclose(R_cv_from_s, kept.R_cv_from_s, rtol=0.0, atol=1e-9)
        and np.allclose(t_cv, told, rtol=0.0, atol=1e-9 * kept.t_z)
        and np.allclose(K, kept.K, rtol=1e-9, atol=1e-6)
    )
    if same:
        return kept
    try:
        require_rotation(np.clip(R_cv_from_s, -10.0, 10.0), "its rotation")
    except ValueError as error:
        raise InputError(f"{where} has an unusable pose: {error}") from None
    axial = t_cv[2] > 0 and np.abs(t_cv[:2]).max() <= 1e-9 * t_cv[2]
    square = K[0, 1] == K[1, 0] == 0.0 and K[0, 0] == K[1, 1] > 0
    if not (axial and square):
        raise InputError(
            f"{where} has a pose whose origin is off the optical axis, which no 4-DoF annotation can have: "
            "read it as a data set with `cadpose dataset convert`"
        )
    principal = (float(K[0, 2]), float(K[1, 2]))
    try:
        return PosePart.of_pose(
            Pose4Dof(Rotation.from_matrix(R_cv_from_s), float(K[0, 0]), principal, float(t_cv[2]))
        )
    except ValueError as error:
        raise InputError(f"{where} has an unusable pose: {error}") from None


def told_error(error: Exception) -> str:
    """The first thing that a validation found, short enough for a sentence."""
    if isinstance(error, ValidationError):
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        text = f"{'.'.join(str(step) for step in first['loc'])}: {first['msg']}"
    else:
        text = str(error).splitlines()[0] if str(error) else type(error).__name__
    return "".join(c if c.isprintable() else "?" for c in text[:200])


def located(path: Path, what: str, number: int) -> str:
    """``FILE: annotation 3``."""
    return f"{path}: {what} {number}"


def _same(a: Sequence[float], b: Any) -> bool:
    try:
        kept = np.asarray(b, np.float64)
    except (TypeError, ValueError, OverflowError):  # JSON knows whole numbers of any length
        return False
    return kept.shape == (len(a),) and bool(np.abs(kept - np.asarray(a)).max() <= SAME)
