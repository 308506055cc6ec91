"""Annotations as flat rows, one an annotation: what CSV and Parquet share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from typing import Any

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.extras import Native, annotation_from, document_from_parts
from cadpose.annotations.parts import MaskPart
from cadpose.errors import InputError
from cadpose.rle import runs_from_text, text_from_runs

Cell = str | int | float | bool | None
Row = dict[str, Cell]

#: Column to the type of its values; `None` in a cell means that nothing is told.
COLUMNS: dict[str, type] = {
    "photo_name": str, "photo_sha256": str, "photo_width": int, "photo_height": int, "position": int,
    "category": str, "score": float, "source": str, "x0": float, "y0": float, "x1": float, "y1": float,
    "truncated": bool, "tiny": bool, "unsure": bool, "azimuth": float, "elevation": float, "inplane": float,
    "focal_px": float, "principal_x": float, "principal_y": float, "t_z": float, "cad_id": str,
    "cad_name": str, "cad_category": str, "cad_licence": str, "cad_creator": str, "cad_source": str,
    "cad_width_cm": float, "cad_depth_cm": float, "cad_height_cm": float, "cad_faces": int,
    "cad_sha256": str, "cad_score": float, "cad_probability": float, "none_probability": float,
    "cad_needs_review": bool, "box_iou": float, "mask_iou": float, "confidence": float, "verdict": str,
    "mask": str,
}  # fmt: skip
_CAD = {
    **{name: f"cad_{name}" for name in ("id", "name", "category", "licence", "creator", "source", "sha256")},
    "face_count": "cad_faces",
}
_SIDES = ("cad_width_cm", "cad_depth_cm", "cad_height_cm")
_SHARED = ("none_probability", "cad_needs_review", "box_iou", "mask_iou", "confidence", "verdict")


def rows_of(document: AnnotationDocument) -> Iterator[tuple[Row, AnnotationPart]]:
    """The rows of a photo's annotations, each with the annotation."""
    photo = document.photo
    for position, part in enumerate(document.annotations):
        found, pose, first = part.detection, part.pose, part.candidates[0]
        row: Row = dict.fromkeys(COLUMNS)
        row |= {
            "photo_name": photo.name,
            "photo_sha256": photo.sha256,
            "photo_width": photo.size[0],
            "photo_height": photo.size[1],
            "position": position,
            **{name: getattr(found, name) for name in ("category", "score", "source")},
            **dict(zip(("x0", "y0", "x1", "y1"), found.box, strict=True)),
            **{name: getattr(found, name) for name in ("truncated", "tiny", "unsure")},
            **{n: getattr(pose, n) for n in ("azimuth", "elevation", "inplane", "focal_px", "t_z")},
            "principal_x": pose.principal_px[0],
            "principal_y": pose.principal_px[1],
            **{column: getattr(part.cad, name) for name, column in _CAD.items()},
            **dict(zip(_SIDES, part.cad.size_cm or (None, None, None), strict=True)),
            "cad_score": first.score,
            "cad_probability": first.probability,
            **{name: getattr(part, name) for name in _SHARED},
            "mask": None if found.mask is None else text_from_runs(found.mask.counts),
        }
        yield row, part


def documents_of(
    rows: Iterable[tuple[str, Mapping[str, Any]]],
    extras: Callable[[Mapping[str, Any], str], dict[str, Any]],
) -> Iterator[AnnotationDocument]:
    """Documents from rows; those of one photo stand together.

    Args:
        rows: (where, row).
        extras: Our keys of a row, as `extras_of` writes them.

    Raises:
        InputError: a row is wrong, or the rows of a photo are scattered.
    """
    done: set[bytes] = set()
    for sha256, group in groupby(rows, key=lambda told: told[1]["photo_sha256"]):
        parts = []
        where = ""
        row: Mapping[str, Any] = {}
        for where, row in group:
            parts.append(annotation_from(extras(row, where), _native(row, where), where))
        key = str(sha256).encode()[:64]
        if key in done:
            raise InputError(
                f"{where}: the rows of photo {row['photo_name']} are scattered, sort by photo_sha256"
            )
        done.add(key)
        photo = {
            "name": row["photo_name"],
            "sha256": sha256,
            "size": [row["photo_width"], row["photo_height"]],
        }
        yield document_from_parts(photo, parts, where)


def _native(row: Mapping[str, Any], where: str) -> Native:
    mask = None
    if row["mask"]:
        try:
            size = (int(row["photo_height"]), int(row["photo_width"]))
            mask = MaskPart(size=size, counts=runs_from_text(row["mask"]))
        except (ValueError, TypeError) as error:
            raise InputError(f"{where} has an unusable mask ({str(error).splitlines()[0]})") from None
    box = tuple(row[name] for name in ("x0", "y0", "x1", "y1"))
    if not all(isinstance(value, float) for value in box):
        raise InputError(f"{where} has no box: x0, y0, x1 and y1 are numbers")
    return Native(box, row["category"], mask, True)


def extras_from_row(row: Mapping[str, Any], source: str) -> dict[str, Any]:
    """What a row alone tells: the chosen CAD model is the only candidate, and there are no hypotheses."""
    angles = {name: row[name] for name in ("azimuth", "elevation", "inplane")}
    sides = [row[name] for name in _SIDES]
    cad = {name: row[column] for name, column in _CAD.items()}
    cad["size_cm"] = None if None in sides else sides
    focal, x, y = row["focal_px"], row["principal_x"], row["principal_y"]
    candidate = {
        "rank": 1,
        "cad": cad,
        "score": row["cad_score"],
        "rotation": angles,
        "measures": {},
        "probability": row["cad_probability"],
    }
    return {
        "detection": {
            "box": [row[name] for name in ("x0", "y0", "x1", "y1")],
            **{n: row[n] for n in ("category", "score", "source", "truncated", "tiny", "unsure")},
            "alternatives": [],
            "rotation": None,
            "mask": None,
        },
        "pose": {
            **angles,
            "focal_px": focal,
            "principal_px": [x, y],
            "t_z": row["t_z"],
            "R_cv_from_s": _matrix(angles),
            "K": [[focal, 0.0, x], [0.0, focal, y], [0.0, 0.0, 1.0]],
        },
        "cad": cad,
        "candidates": [candidate],
        "hypotheses": [],
        **{name: row[name] for name in _SHARED},
        "seconds": {},
        "provenance": {"imported_from": source},
    }


def _matrix(angles: Mapping[str, Any]) -> Any:
    from cadpose.geometry.angles import rotation_from_angles

    try:
        return rotation_from_angles(angles["azimuth"], angles["elevation"], angles["inplane"]).tolist()
    except (TypeError, ValueError):
        return None
