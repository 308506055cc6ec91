"""Back from a BOP folder that `cadpose export bop` wrote."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.bop_models import diagonal_mm
from cadpose.annotations.formats.extras import (
    Native,
    annotation_from,
    document_from_parts,
    native_pose,
    photo_size,
)
from cadpose.annotations.formats.pictures import read_mask
from cadpose.annotations.parts import MaskPart, PosePart
from cadpose.datasets.files import json_lines, read_json
from cadpose.errors import InputError
from cadpose.geometry.frames import R_b_from_s
from cadpose.rle import encode_mask


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a folder: poses and masks as BOP's own files tell them.

    Raises:
        InputError: the folder is not one that `cadpose export bop` wrote, or a pose was changed to one that
            no 4-DoF annotation can have.
    """
    scenes = sorted(path.glob("test/*/cadpose.jsonl"))
    if not scenes:
        raise InputError(
            f"{path} is no folder of `cadpose export bop` (it has no test/*/cadpose.jsonl): "
            "read BOP data sets of others with `cadpose dataset convert bop`"
        )
    told: set[bytes] = set()
    for lines in scenes:
        scene = lines.parent
        poses, cameras = (_table(scene / f"scene_{name}.json") for name in ("gt", "camera"))
        entries = ((f"{lines}: line {number}", line) for number, line in json_lines(lines))
        for sha256, group in groupby(entries, key=lambda entry: _digest(*entry)):
            parts: list[tuple[int, AnnotationPart]] = []
            where = ""
            line: dict[str, Any] = {}
            for where, line in group:
                parts.append((line.get("position", 0), _part(scene, line, poses, cameras, where)))
            if sha256 in told:
                raise InputError(f"{where}: a photo's lines are scattered, sort them by photo")
            told.add(sha256)
            parts.sort(key=lambda entry: entry[0])
            yield document_from_parts(line["photo"], [part for _, part in parts], where)


def _part(
    scene: Path, line: dict[str, Any], poses: dict[str, Any], cameras: dict[str, Any], where: str
) -> AnnotationPart:
    image, place = line.get("im_id"), line.get("gt_id")
    if not (isinstance(image, int) and isinstance(place, int) and image >= 0 and place >= 0):
        raise InputError(f"{where} lacks im_id or gt_id: export again")
    try:
        gt = poses[str(image)][place]
        K = np.array(cameras[str(image)]["cam_K"], np.float64).reshape(3, 3)
        R = np.array(gt["cam_R_m2c"], np.float64).reshape(3, 3) @ R_b_from_s
        t = np.array(gt["cam_t_m2c"], np.float64).reshape(3)
        same_model = gt["obj_id"] == line.get("obj_id")
    except (KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"{where}: scene_gt.json or scene_camera.json lacks its pose ({error!r})") from None
    if not same_model:
        raise InputError(f"{where}: its obj_id was changed in scene_gt.json, so its CAD model is unknown")
    plain = annotation_from(line.get("annotation"), Native(), where)
    t = t / diagonal_mm(plain.cad)
    pose: PosePart | None = None
    if line.get("photo_camera") is True:
        whole = plain.pose_6dof
        kept = None if whole is None else (whole.R_cv_from_s, whole.t_cv)
        if kept is None or not (np.allclose(R, kept[0], atol=1e-9) and np.allclose(t, kept[1], rtol=1e-9)):
            raise InputError(
                f"{where}: its pose in the photo's camera was changed, read it with `cadpose dataset convert`"
            )
    else:
        pose = native_pose(plain.pose, R, t, K, where)
    mask = None
    if line.get("has_mask") is True:
        width, height = photo_size(line["photo"], where)
        drawn = read_mask(scene / "mask_visib" / f"{image:06d}_{place:06d}.png", (height, width))
        mask = MaskPart(size=(height, width), counts=encode_mask(drawn))
    return annotation_from(line["annotation"], Native(mask=mask, has_mask=True, pose=pose), where)


def _table(path: Path) -> dict[str, Any]:
    told = read_json(path)
    if not isinstance(told, dict):
        raise InputError(f"{path} is no table of BOP's by image: export again")
    return told


def _digest(where: str, line: Any) -> bytes:
    photo = line.get("photo") if isinstance(line, dict) else None
    sha256 = photo.get("sha256") if isinstance(photo, dict) else None
    if not isinstance(sha256, str):
        raise InputError(f"{where} names no photo: export again")
    return sha256[:64].encode()
