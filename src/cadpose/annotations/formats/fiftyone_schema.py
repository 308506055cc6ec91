"""FiftyOne's description of a dataset, ``metadata.json``."""

from __future__ import annotations

from typing import Any


def dataset_document(media: str, field: str | None) -> dict[str, Any]:
    """The document of a dataset.

    Args:
        media: ``"image"`` or ``"3d"``.
        field: A field of detections, if it has one.
    """
    return {"media_type": media, "field": field}
