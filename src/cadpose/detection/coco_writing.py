"""COCO JSON of detections, as :mod:`cadpose.detection.coco_json` and pycocotools read it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from cadpose.records import Detection, Mask
from cadpose.rle import encode_mask, text_from_runs


class CocoWriter:
    """Gathers the detections of many photos; masks are kept as run lengths."""

    def __init__(self) -> None:
        self._images: list[dict[str, Any]] = []
        self._categories: dict[str, int] = {}
        self._annotations: list[dict[str, Any]] = []

    def add(self, name: str, width: int, height: int, detections: Sequence[Detection]) -> None:
        """A photo, also one in which nothing was found, by the name that it will be looked for."""
        image = len(self._images) + 1
        # A name that is not UTF-8 is spelt with escapes: JSON cannot carry it, and no reader finds it again.
        told_name = name.encode("utf-8", "backslashreplace").decode("utf-8")
        self._images.append({"id": image, "file_name": told_name, "width": width, "height": height})
        for d in detections:
            category = self._categories.setdefault(d.category, len(self._categories) + 1)
            told: dict[str, Any] = {
                "id": len(self._annotations) + 1,
                "image_id": image,
                "category_id": category,
                "bbox": list(d.box.to_xywh()),
                "area": d.box.area if d.mask is None else int(np.count_nonzero(d.mask)),
                "iscrowd": 0,
                "score": d.score,
            }
            if d.mask is not None:
                told["segmentation"] = compressed_mask(d.mask)
            if d.rotation is not None:
                r = d.rotation
                told |= {"azimuth": r.azimuth, "elevation": r.elevation, "inplane": r.inplane}
            told |= {"truncated": d.truncated, "tiny": d.tiny, "unsure": d.unsure}
            told["alternatives"] = [{"category": c, "score": s} for c, s in d.alternatives]
            self._annotations.append(told)

    def to_json(self) -> bytes:
        """The file's content, UTF-8."""
        content = {
            "images": self._images,
            "categories": [{"id": i, "name": name} for name, i in self._categories.items()],
            "annotations": self._annotations,
        }
        return json.dumps(content, allow_nan=False).encode()


def compressed_mask(mask: Mask) -> dict[str, Any]:
    """COCO's compressed run lengths of a (H, W) mask: ``size`` [height, width] and ``counts``, text."""
    return {"size": [int(side) for side in mask.shape], "counts": text_from_runs(encode_mask(mask))}
