"""What a person's edit makes of the machine's annotation."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.database.results import Region
from cadpose.annotations.parts import CadPart, DetectionPart, PosePart
from cadpose.annotations.pose_parts import Pose6DofPart, depth_of, pose_of
from cadpose.detection.flags import flagged
from cadpose.geometry.boxes import Box
from cadpose.poses import Pose6Dof
from cadpose.records import Detection
from cadpose.rle import decode_mask, encode_mask


def region_json(region: Region) -> dict[str, Any]:
    """A region as it is kept with a decision."""
    mask = region.mask
    runs = None if mask is None else {"size": list(mask.shape), "counts": encode_mask(mask)}
    return {"box": [float(value) for value in region.box.to_tuple()], "mask": runs}


def region_of(data: Mapping[str, Any]) -> Region:
    """Back from JSON."""
    runs = data["mask"]
    return Region(Box(*data["box"]), None if runs is None else decode_mask(runs["size"], runs["counts"]))


def edited(
    part: AnnotationPart,
    edit: Mapping[str, Any],
    cad: Mapping[str, Any] | None,
    photo_size: tuple[int, int],
) -> AnnotationPart:
    """The annotation with an edit's pose, model and region.

    What the machine said of its own answer (confidence, verdict, refinement, what needs review) falls away,
    and so does the mask IoU where none was told with the edit. The set model comes first among the
    candidates, with no chance of its own unless it was one. ``provenance`` gets who edited it, and when.

    Args:
        part: The machine's.
        edit: As :func:`cadpose.annotations.database.standing.settled` gives it.
        cad: JSON of the model that was set; None where it was left.
        photo_size: (width, height) in pixels.
    """
    data = part.model_dump(mode="json", by_alias=True)
    pose = pose_of(edit["pose"]) if edit.get("pose") else part.pose.pose()
    data["pose"] = PosePart.of_pose(pose).model_dump(mode="json")
    if edit.get("region"):
        data["detection"] = _redrawn(part.detection.record(), edit["region"], photo_size)
    if cad is not None:
        rotation = {name: data["pose"][name] for name in ("azimuth", "elevation", "inplane")}
        _put_first(data, cad, rotation)
    data |= {"refinement": None, "confidence": None, "verdict": None, "cad_needs_review": False}
    data["hypotheses"] = [hypothesis | {"needs_review": False} for hypothesis in data["hypotheses"]]
    measures = edit.get("measures") or {}
    data["mask_iou"] = measures.get("mask_iou")
    data["box_iou"] = measures.get("box_iou", data["box_iou"])
    if part.pose_6dof is not None:
        known = part.pose_6dof
        diagonal = known.diagonal_m if cad is None else _diagonal_m(cad)
        whole = Pose6DofPart.of(Pose6Dof.from_4dof(pose, known.pose().camera, diagonal))
        data |= {"pose_6dof": whole.model_dump(mode="json"), "depth": depth_of(whole)}
    data["provenance"]["edited"] = {name: edit[name] for name in ("by", "kind", "at")}
    return AnnotationPart.model_validate_json(json.dumps(data))


def _redrawn(detection: Detection, region: Mapping[str, Any], photo_size: tuple[int, int]) -> dict[str, Any]:
    drawn = region_of(region)
    whole = flagged(replace(detection, box=drawn.box, mask=drawn.mask), *photo_size)
    return DetectionPart.of(whole).model_dump(mode="json")


def _put_first(data: dict[str, Any], cad: Mapping[str, Any], rotation: Mapping[str, Any]) -> None:
    old = data["candidates"]
    same = [candidate for candidate in old if candidate["cad"] == cad]
    fresh = {"score": old[0]["score"], "measures": {}, "probability": None}
    first = {**(same[0] if same else fresh), "cad": dict(cad), "rotation": dict(rotation)}
    ranked = [first, *(candidate for candidate in old if candidate not in same)]
    data["candidates"] = [{**candidate, "rank": rank} for rank, candidate in enumerate(ranked, start=1)]
    data["cad"] = CadPart.model_validate_json(json.dumps(dict(cad))).model_dump(mode="json")


def _diagonal_m(cad: Mapping[str, Any]) -> float | None:
    size = cad["size_cm"]
    return None if size is None else float(np.linalg.norm(size)) / 100.0
