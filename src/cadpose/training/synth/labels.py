"""A synthetic object as JSON, as a line of a label file and as an annotation of COCO's JSON."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cadpose.datasets.labels import Label, RunLengths
from cadpose.geometry.boxes import Box
from cadpose.records import Rotation
from cadpose.rle import encode_mask, text_from_runs
from cadpose.training.synth.records import SynthObject

#: What ``Label.source`` says of a synthetic photo.
SOURCE = "synth"
#: Decimals of pixels and degrees in label files: far below what is seen, and short.
_DECIMALS = 4


def object_to_json(found: SynthObject) -> dict[str, Any]:
    """Everything that labels tell of an object, in plain lists and numbers."""
    rotation = found.rotation
    return {
        "cad": found.cad,
        "category": found.category,
        "rotation": [
            round(v, _DECIMALS + 2) for v in (rotation.azimuth, rotation.elevation, rotation.inplane)
        ],
        "focal_px": round(found.focal_px, _DECIMALS),
        "principal_px": [round(v, _DECIMALS) for v in found.principal_px],
        "t_z": round(found.t_z, _DECIMALS + 2),
        "box": [round(v, _DECIMALS) for v in found.box.to_tuple()],
        "visible_box": list(found.visible_box.to_tuple()),
        "mask": {"size": list(found.mask.shape), "counts": text_from_runs(encode_mask(found.mask))},
        "area": int(found.mask.sum()),
        "visible": round(found.visible, _DECIMALS),
        "truncated": found.truncated,
        "occluded": found.occluded,
    }


def label_from_json(photo: Path, entry: dict[str, Any]) -> Label:
    """The label of an object that :func:`object_to_json` told."""
    rotation = Rotation(*entry["rotation"])
    height, width = entry["mask"]["size"]
    first, second, third = (tuple(float(v) for v in row) for row in rotation.to_matrix())
    return Label(
        photo=photo,
        category=entry["category"],
        box=Box(*entry["box"]),
        cad=entry["cad"],
        azimuth=rotation.azimuth,
        elevation=rotation.elevation,
        inplane=rotation.inplane,
        mask=RunLengths((height, width), entry["mask"]["counts"]),
        focal_px=entry["focal_px"],
        principal_px=(entry["principal_px"][0], entry["principal_px"][1]),
        R_cv_from_s=(
            (first[0], first[1], first[2]),
            (second[0], second[1], second[2]),
            (third[0], third[1], third[2]),
        ),
        t_cv=(0.0, 0.0, entry["t_z"]),
        truncated=entry["truncated"],
        occluded=entry["occluded"],
        source=SOURCE,
        synthetic=True,
    )


def coco_of(photos: Sequence[tuple[str, int, Sequence[dict[str, Any]]]]) -> dict[str, Any]:
    """COCO's object-detection JSON, with the pose as further keys of each annotation.

    ``bbox`` and ``segmentation`` are of what is seen, as in COCO; ``amodal_bbox`` is of the whole object.

    Args:
        photos: File name, side in pixels, and the objects as :func:`object_to_json` tells them.
    """
    names = sorted({entry["category"] for _, _, objects in photos for entry in objects})
    number = {name: i + 1 for i, name in enumerate(names)}
    annotations: list[dict[str, Any]] = []
    for image, (_, _, objects) in enumerate(photos, 1):
        for entry in objects:
            azimuth, elevation, inplane = entry["rotation"]
            annotations.append(
                {
                    "id": len(annotations) + 1,
                    "image_id": image,
                    "category_id": number[entry["category"]],
                    "bbox": _xywh(entry["visible_box"]),
                    "area": entry["area"],
                    "segmentation": entry["mask"],
                    "iscrowd": 0,
                    "amodal_bbox": _xywh(entry["box"]),
                    "cad": entry["cad"],
                    "azimuth": azimuth,
                    "elevation": elevation,
                    "inplane": inplane,
                    "focal_px": entry["focal_px"],
                    "principal_px": entry["principal_px"],
                    "t_z": entry["t_z"],
                    "visible": entry["visible"],
                    "truncated": entry["truncated"],
                    "occluded": entry["occluded"],
                }
            )
    images = [
        {"id": i, "file_name": name, "width": side, "height": side}
        for i, (name, side, _) in enumerate(photos, 1)
    ]
    return {
        "info": {"description": "Synthetic photos made by cadpose"},
        "images": images,
        "categories": [{"id": number[name], "name": name} for name in names],
        "annotations": annotations,
    }


def _xywh(corners: Sequence[float]) -> list[float]:
    x0, y0, x1, y1 = corners
    return [x0, y0, round(x1 - x0, _DECIMALS), round(y1 - y0, _DECIMALS)]
