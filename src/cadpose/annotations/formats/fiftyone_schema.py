"""FiftyOne's description of a dataset, ``metadata.json``: its fields with their types, as of version 1.0.

FiftyOne brings what an earlier version wrote up to date when it is read, and refuses what a later one wrote.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

_VERSION = "1.0.0"
_FIELDS = "fiftyone.core.fields."
_DOCUMENT, _LIST = "EmbeddedDocumentField", "ListField"


def dataset_document(media: str, field: str | None) -> dict[str, Any]:
    """The document of a dataset.

    Args:
        media: ``"image"`` or ``"3d"``.
        field: A field of detections, if it has one.
    """
    metadata = [_field("size_bytes", "IntField"), _field("mime_type", "StringField")]
    kind = "Metadata"
    if media == "image":
        kind = "ImageMetadata"
        metadata += [_field(name, "IntField") for name in ("width", "height", "num_channels")]
    fields = [
        _field("id", "ObjectIdField", db="_id", read_only=True),
        _field("filepath", "StringField"),
        _field("tags", _LIST, subfield="StringField"),
        _field("metadata", _DOCUMENT, document=f"fiftyone.core.metadata.{kind}", fields=metadata),
        _field("created_at", "DateTimeField", read_only=True),
        _field("last_modified_at", "DateTimeField", read_only=True),
        _field("photo_name", "StringField"),
    ]
    if field is not None:
        fields += [_detections(field), _field("cadpose", "StringField")]
    return {
        "name": "cadpose",
        "slug": "cadpose",
        "version": _VERSION,
        "persistent": False,
        "media_type": media,
        "group_media_types": {},
        "tags": [],
        "info": {},
        "app_config": {"color_scheme": None, "plugins": {}},
        "classes": {},
        "default_classes": [],
        "mask_targets": {},
        "default_mask_targets": {},
        "skeletons": {},
        "sample_fields": fields,
        "frame_fields": [],
        "saved_views": [],
        "workspaces": [],
        "annotation_runs": {},
        "brain_methods": {},
        "evaluations": {},
        "runs": {},
    }


def _detections(name: str) -> dict[str, Any]:
    own = [
        _field("id", "ObjectIdField", db="_id"),
        _field("tags", _LIST, subfield="StringField"),
        _field("label", "StringField"),
        _field("bounding_box", _LIST, subfield="FloatField"),
        _field("mask", "ArrayField"),
        _field("mask_path", "StringField"),
        _field("confidence", "FloatField"),
        _field("index", "IntField"),
        *(_field(word, "StringField") for word in ("cad", "cad_name", "scene", "cadpose")),
        *(_field(number, "FloatField") for number in ("azimuth", "elevation", "inplane", "focal_px")),
    ]
    each = _field(
        "detections", _LIST, subfield=_DOCUMENT, document="fiftyone.core.labels.Detection", fields=own
    )
    return _field(name, _DOCUMENT, document="fiftyone.core.labels.Detections", fields=[each])


def _field(
    name: str,
    kind: str,
    *,
    document: str | None = None,
    subfield: str | None = None,
    fields: Sequence[dict[str, Any]] = (),
    db: str | None = None,
    read_only: bool = False,
) -> dict[str, Any]:
    return {
        "name": name,
        "ftype": _FIELDS + kind,
        "embedded_doc_type": document,
        "subfield": None if subfield is None else _FIELDS + subfield,
        "fields": list(fields),
        "db_field": db or name,
        "description": None,
        "info": None,
        "read_only": read_only,
        "created_at": None,
    }
