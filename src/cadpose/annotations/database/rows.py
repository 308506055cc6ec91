"""What a document becomes in the tables, and the digests that are its keys.

Everything is worked out from the JSON alone, so that ``check`` and ``merge`` do it again from what is stored,
also of documents that an earlier version wrote.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from cadpose.annotations.document import AnnotationDocument

Row = dict[str, Any]
#: Columns that a person's edit changes.
CURRENT = (
    "azimuth",
    "elevation",
    "inplane",
    "focal_px",
    "principal_x",
    "principal_y",
    "t_z",
    "cad_key",
    "cad_id",
)
_ANGLES = ("azimuth", "elevation", "inplane")


@dataclass(slots=True)
class DocumentRows:
    """Every table's rows of one document; those of ``cads`` and ``provenances`` by key."""

    photo: Row
    annotations: list[Row] = field(default_factory=list)
    candidates: list[Row] = field(default_factory=list)
    hypotheses: list[Row] = field(default_factory=list)
    failures: list[Row] = field(default_factory=list)
    detections: dict[str, Row] = field(default_factory=dict)
    cads: dict[str, Row] = field(default_factory=dict)
    provenances: dict[str, Row] = field(default_factory=dict)


# Made once: `json.dumps` would make one for every value.
_canonical = json.JSONEncoder(sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode


def _hashed(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def digest(*values: Any) -> str:
    """64 hex digits of values that JSON can carry; equal values give equal digits."""
    return _hashed(_canonical(values))


def short_digest(*values: Any) -> str:
    """32 hex digits."""
    return digest(*values)[:32]


def document_json(document: AnnotationDocument) -> dict[str, Any]:
    """The document as JSON's own types."""
    # Through text, which is several times as quick as model_dump.
    data: dict[str, Any] = json.loads(document.model_dump_json(by_alias=True))
    return data


def annotation_id(photo_sha256: str, position: int, part: Mapping[str, Any]) -> str:
    """Key of an annotation: its photo, its place in the document and what it says, timings aside."""
    return _annotation_id(photo_sha256, position, _canonical(_untimed(part)))


def content_digest(data: Mapping[str, Any]) -> str:
    """Digest of a document, timings aside."""
    return _content_digest(data, [_canonical(_untimed(part)) for part in data["annotations"]])


def _annotation_id(photo_sha256: str, position: int, text: str) -> str:
    # The digest of the three values together; the long one of them is written once for both digests.
    return _hashed(f'["{photo_sha256}",{position},{text}]')


def _content_digest(data: Mapping[str, Any], texts: Sequence[str]) -> str:
    written = {name: _canonical(value) for name, value in data.items() if name != "annotations"}
    written["annotations"] = f"[{','.join(texts)}]"
    members = ",".join(f'"{name}":{written[name]}' for name in sorted(written))
    return _hashed(f"[{{{members}}}]")


def rows_of(data: Mapping[str, Any]) -> DocumentRows:
    """The rows of a document given as JSON; times and decisions are the writer's to add."""
    photo = data["photo"]
    sha256 = photo["sha256"]
    texts = [_canonical(_untimed(part)) for part in data["annotations"]]
    content = _content_digest(data, texts)
    rows = DocumentRows(
        photo={
            "sha256": sha256,
            "name": photo["name"],
            "width": photo["size"][0],
            "height": photo["size"][1],
            "schema_version": data["schema"],
            "content_sha256": content,
        }
    )
    for position, part in enumerate(data["annotations"]):
        key = _annotation_id(sha256, position, texts[position])
        add_annotation(rows, key, sha256, content, position, part)
    for position, failure in enumerate(data["failures"]):
        found = _detection(rows, sha256, failure["detection"])
        rows.failures.append(
            {
                "photo_sha256": sha256,
                "position": position,
                "detection_id": found,
                "category": failure["detection"]["category"],
                "stage": failure["stage"],
                "reason": failure["reason"],
                "document": dict(failure),
            }
        )
    return rows


def add_annotation(
    rows: DocumentRows,
    key: str,
    photo_sha256: str,
    content_sha256: str,
    position: int,
    part: Mapping[str, Any],
) -> None:
    """Add the rows of one annotation under its key."""
    confidence, verdict = part.get("confidence"), part.get("verdict")
    rows.annotations.append(
        {
            "id": key,
            "photo_sha256": photo_sha256,
            "position": position,
            "document_sha256": content_sha256,
            "detection_id": _detection(rows, photo_sha256, part["detection"]),
            "provenance_key": _provenance(rows, part["provenance"]),
            "category": part["detection"]["category"],
            **pose_columns(part["pose"]),
            "cad_key": add_cad(rows.cads, part["cad"]),
            "cad_id": part["cad"]["id"],
            "box_iou": part["box_iou"],
            "mask_iou": part["mask_iou"],
            "cad_probability": part["candidates"][0].get("probability"),
            "none_probability": part.get("none_probability"),
            "cad_needs_review": part.get("cad_needs_review", False),
            "confidence": confidence,
            "priority": -1.0 if confidence is None else confidence,
            "machine_verdict": verdict,
            "document": dict(part),
        }
    )
    rows.candidates += [
        {
            "annotation_id": key,
            "rank": candidate["rank"],
            "cad_key": add_cad(rows.cads, candidate["cad"]),
            "score": candidate["score"],
            **{name: candidate["rotation"][name] for name in _ANGLES},
            "measures": candidate["measures"],
            "probability": candidate.get("probability"),
        }
        for candidate in part["candidates"]
    ]
    rows.hypotheses += [
        {
            "annotation_id": key,
            "rank": rank,
            **{name: hypothesis["rotation"][name] for name in _ANGLES},
            "score": hypothesis["score"],
            "probability": hypothesis["probability"],
            "expected_error": hypothesis.get("expected_error"),
            "needs_review": hypothesis.get("needs_review", False),
        }
        for rank, hypothesis in enumerate(part["hypotheses"], start=1)
    ]


def pose_columns(pose: Mapping[str, Any]) -> Row:
    """The columns of a pose given as JSON."""
    x, y = pose["principal_px"]
    return {
        **{name: pose[name] for name in _ANGLES},
        "focal_px": pose["focal_px"],
        "principal_x": x,
        "principal_y": y,
        "t_z": pose["t_z"],
    }


def add_cad(cads: dict[str, Row], cad: Mapping[str, Any]) -> str:
    """Put a model given as JSON among the rows; its key."""
    size = cad["size_cm"]
    told = tuple(cad[name] for name in _CAD_COLUMNS)
    key = _cad_key(told, None if size is None else tuple(size))
    if key not in cads:
        width, depth, height = size or (None, None, None)
        named = dict(zip(_CAD_COLUMNS, told, strict=True))
        cads[key] = {"key": key, **named, "width_cm": width, "depth_cm": depth, "height_cm": height}
    return key


@lru_cache(maxsize=20_000)
def _cad_key(told: tuple[Any, ...], size: tuple[float, ...] | None) -> str:
    """Digest of a model's JSON; the same few models come again and again."""
    named = dict(zip(_CAD_COLUMNS, told, strict=True))
    return short_digest(named | {"size_cm": None if size is None else list(size)})


_CAD_COLUMNS = ("id", "name", "category", "licence", "creator", "source", "face_count", "sha256")


def cad_json(row: Mapping[str, Any]) -> dict[str, Any]:
    """The model of a row of ``cads`` as the document writes it."""
    size = [row["width_cm"], row["depth_cm"], row["height_cm"]]
    told = {name: row[name] for name in _CAD_COLUMNS}
    return {**told, "size_cm": None if None in size else size}


def ordered(rows: Mapping[str, Row]) -> Sequence[Row]:
    """By key, as two writers must insert them so that neither waits for the other."""
    return [rows[key] for key in sorted(rows)]


def _detection(rows: DocumentRows, photo_sha256: str, detection: Mapping[str, Any]) -> str:
    key = short_digest(photo_sha256, detection)
    if key not in rows.detections:
        box = dict(zip(("box_x0", "box_y0", "box_x1", "box_y1"), detection["box"], strict=True))
        # Documents of earlier versions lack the flags.
        flags = {name: detection.get(name, False) for name in ("truncated", "tiny", "unsure")}
        rows.detections[key] = {
            "id": key,
            "photo_sha256": photo_sha256,
            "category": detection["category"],
            "score": detection["score"],
            "source": detection["source"],
            **box,
            **flags,
            "masked": detection["mask"] is not None,
        }
    return key


def _provenance(rows: DocumentRows, provenance: Mapping[str, Any]) -> str:
    key = short_digest(provenance)
    rows.provenances.setdefault(
        key,
        {
            "key": key,
            "tool_version": str(provenance.get("cadpose") or "unknown"),
            "library": str(provenance.get("library") or ""),
            "document": dict(provenance),
        },
    )
    return key


def _untimed(part: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value for name, value in part.items() if name != "seconds"}
