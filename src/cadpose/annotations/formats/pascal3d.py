"""Viewpoints as PASCAL3D+ writes them, in JSON instead of .mat: exactly our four degrees of freedom.

PASCAL3D+'s camera looks straight at the object and has a principal point of its own (``px``, ``py``), as
ours has: azimuth, elevation and theta are the three angles, ``focal`` times ``viewport`` the focal length in
pixels, ``distance`` is t_z in model diagonals. MATLAB's pixels count from 1, a box includes its last pixel.
``cad_index`` counts a class's models from 1; ``cads`` lists their ids.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.extras import (
    Native,
    annotation_from,
    document_from_parts,
    extras_of,
    located,
    native_pose,
    photo_extras,
    told_error,
)
from cadpose.annotations.formats.format import Format
from cadpose.annotations.formats.json_stream import JsonArrays, iter_json
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import portable_name
from cadpose.annotations.parts import PosePart
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.labels import from_pascal3d, to_pascal3d

_WHAT = "a JSON file of `cadpose export pascal3d`"


def write(documents: Iterable[AnnotationDocument], out: Path, sources: Sources) -> None:
    """Write one JSON file."""
    cads: dict[str, dict[str, int]] = {}
    with JsonArrays(out, ["records"]) as file:
        for document in documents:
            width, height = document.photo.size
            record = {
                "filename": portable_name(document.photo.name),
                "imgsize": [width, height, 3],
                "objects": [_object(part, cads) for part in document.annotations],
                "cadpose": photo_extras(document),
            }
            file.add("records", record)
        file.more["cads"] = {name: list(ids) for name, ids in cads.items()}


def _object(part: AnnotationPart, cads: dict[str, dict[str, int]]) -> dict[str, Any]:
    found, pose = part.detection, part.pose
    x0, y0, x1, y1 = found.box
    known = cads.setdefault(found.category, {})
    azimuth, elevation, theta = to_pascal3d(pose.azimuth, pose.elevation, pose.inplane)
    return {
        "class": found.category,
        "bbox": [x0 + 1.0, y0 + 1.0, x1, y1],
        "truncated": int(found.truncated),
        "occluded": 0,
        "difficult": int(found.tiny or found.unsure),
        "cad_index": known.setdefault(part.cad.id, len(known) + 1),
        "viewpoint": {
            "azimuth": azimuth,
            "elevation": elevation,
            "theta": theta,
            "distance": pose.t_z,
            "focal": 1.0,
            "viewport": pose.focal_px,
            "px": pose.principal_px[0] + 0.5,
            "py": pose.principal_px[1] + 0.5,
        },
        "cadpose": extras_of(part, mask=True),
    }


_Number = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]
_Above = Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e9)]


class _View(BaseModel):
    model_config = ConfigDict(extra="ignore")

    azimuth: _Number
    elevation: Annotated[float, Field(ge=-90.0, le=90.0)]
    theta: _Number
    distance: _Above
    focal: _Above
    viewport: _Above
    px: _Number
    py: _Number


class _Object(BaseModel):
    model_config = ConfigDict(extra="ignore")

    class_: Annotated[str, Field(alias="class", min_length=1)]
    bbox: tuple[_Number, _Number, _Number, _Number]
    viewpoint: _View
    cadpose: dict[str, Any] | None = None


class _Record(BaseModel):
    model_config = ConfigDict(extra="ignore")

    objects: list[_Object]
    cadpose: dict[str, Any] | None = None


def read(path: Path) -> Iterator[AnnotationDocument]:
    """The documents of such a file: boxes, classes and viewpoints as PASCAL3D+'s keys tell them.

    Raises:
        InputError: the file is not one that `write` wrote.
    """
    number = 0
    for key, raw in iter_json(path, _WHAT):
        if key != "records":
            continue
        number += 1
        where = located(path, "record", number)
        try:
            record = _Record.model_validate(raw)
        except ValidationError as error:
            raise InputError(f"{where}: {told_error(error)}") from None
        parts = [_part(o, f"{where}, object {i}") for i, o in enumerate(record.objects, start=1)]
        yield document_from_parts(record.cadpose, parts, where)


def _part(told: _Object, where: str) -> AnnotationPart:
    plain = annotation_from(told.cadpose, Native(), where)
    x0, y0, x1, y1 = told.bbox
    native = Native(
        box=(x0 - 1.0, y0 - 1.0, x1, y1), category=told.class_, pose=_pose(plain.pose, told.viewpoint, where)
    )
    return annotation_from(told.cadpose, native, where)


def _pose(kept: PosePart, view: _View, where: str) -> PosePart:
    focal = view.focal * view.viewport
    K = np.array([[focal, 0.0, view.px - 0.5], [0.0, focal, view.py - 0.5], [0.0, 0.0, 1.0]])
    R = rotation_from_angles(*from_pascal3d(view.azimuth, view.elevation, view.theta))
    return native_pose(kept, R, np.array([0.0, 0.0, view.distance]), K, where)


PASCAL3D = Format("pascal3d", "PASCAL3D+'s viewpoints in JSON, one file", False, write, read)
