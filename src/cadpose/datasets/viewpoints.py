"""Annotations as PASCAL3D+ writes them, which ObjectNet3D shares: one .mat file a photo.

``record.objects`` is a struct array with class, bbox, truncated, occluded, difficult, cad_index, anchors and
viewpoint (azimuth, elevation, azimuth_coarse, elevation_coarse, theta, distance, focal, px, py, viewport).
Read as public loaders read it: those of PoseContrast (data/*/create_annotation.py), StarMap
(tools/get*Dataset.py) and wkentaro/pascal3d. The files themselves have not been seen here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.datasets.dataset import category_of, rotation_of
from cadpose.datasets.label import Label, Matrix
from cadpose.datasets.matlab import read_struct
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.labels import from_pascal3d
from cadpose.records import Rotation


@dataclass(frozen=True)
class Annotated:
    """One photo with its annotation file.

    Attributes:
        photo: The photo.
        file: Its .mat file.
        split: Which split it belongs to.
        only: Class whose objects are read, None for all.
    """

    photo: Path
    file: Path
    split: str
    only: str | None = None


def read_annotated(part: Annotated, source: str, published: bool) -> Iterator[Label]:
    """The labels of one photo; objects without a viewpoint are left out.

    An object whose distance is 0 was labelled coarsely: it gets its coarse azimuth and elevation and no
    camera. One with azimuth, elevation and theta all 0 was never labelled and is left out, as published
    loaders do.

    Args:
        part: The photo.
        source: Name of the data set; CAD ids are ``source/class/nn``, nn counting from 01 as its files do.
        published: Leave out what PoseContrast leaves out: difficult objects, an elevation of exactly 90°,
            and beside the training split objects that are truncated, occluded or without keypoints.

    Raises:
        InputError: the file cannot be used; the message names it and the object.
    """
    record = read_struct(part.file, "record")
    objects = record.get("objects")
    if not isinstance(objects, list):
        raise InputError(f"{part.file}: its record has no objects")
    for number, entry in enumerate(objects):
        where = f"{part.file}: object {number}"
        name = entry.get("class") if isinstance(entry, dict) else None
        if not isinstance(name, str) or not name:
            raise InputError(f"{where} has no class")
        if part.only not in (None, name):
            continue
        try:
            label = _label(entry, name, part, source)
        except ValueError as error:
            raise InputError(f"{where}: {error}") from error
        if label is None:
            continue
        if published and not _is_published(label, entry):
            continue
        yield label


def _is_published(label: Label, entry: dict[str, Any]) -> bool:
    if label.difficult or label.elevation == 90.0:
        return False
    return label.split == "train" or not (label.truncated or label.occluded or not entry.get("anchors"))


def _label(entry: dict[str, Any], name: str, part: Annotated, source: str) -> Label | None:
    views = entry.get("viewpoint")
    if not isinstance(views, list) or not views or not isinstance(views[0], dict):
        return None
    view: dict[str, Any] = views[0]
    rotation, coarse = _rotation(view)
    if rotation is None:
        return None
    bbox = entry.get("bbox")
    if not isinstance(bbox, list) or len(bbox) != 4:
        raise ValueError("has no bbox of four numbers")
    x0, y0, x1, y1 = bbox
    cad = _number(entry, "cad_index")
    focal_px, principal_px, t_cv, R = None, None, None, None
    if not coarse:
        focal_px, principal_px, t_cv = _camera(view)
        R = as_matrix(rotation) if t_cv else None
    return Label(
        photo=part.photo,
        category=category_of(name),
        # MATLAB counts pixels from 1, and a box includes its last pixel.
        box=Box(x0 - 1.0, y0 - 1.0, x1, y1),
        cad=None if cad is None or not 1 <= cad < 1e6 else f"{source}/{name}/{int(cad):02d}",
        azimuth=rotation.azimuth,
        elevation=rotation.elevation,
        inplane=rotation.inplane,
        focal_px=focal_px,
        principal_px=principal_px,
        R_cv_from_s=R,
        t_cv=t_cv,
        split=part.split,
        truncated=bool(_number(entry, "truncated")),
        occluded=bool(_number(entry, "occluded")),
        difficult=bool(_number(entry, "difficult")),
        source=source,
    )


def _rotation(view: dict[str, Any]) -> tuple[Rotation | None, bool]:
    """The rotation, None where nobody gave one, and whether it is coarse."""
    theta = _number(view, "theta") or 0.0
    fine = (_number(view, "azimuth"), _number(view, "elevation"))
    rough = (_number(view, "azimuth_coarse"), _number(view, "elevation_coarse"))
    is_coarse = not _number(view, "distance")
    for azimuth, elevation in (rough, fine) if is_coarse else (fine, rough):
        if azimuth is None or elevation is None:
            continue
        if azimuth == elevation == theta == 0.0:
            return None, is_coarse
        return rotation_of(*from_pascal3d(azimuth, elevation, theta)), is_coarse
    return None, is_coarse


def _camera(
    view: dict[str, Any],
) -> tuple[float | None, tuple[float, float] | None, tuple[float, float, float] | None]:
    """Focal length, principal point and translation of the camera that looks straight at the object."""
    focal, viewport = _number(view, "focal"), _number(view, "viewport")
    x, y, distance = (_number(view, key) for key in ("px", "py", "distance"))
    if not focal or not viewport or x is None or y is None or not distance:
        return None, None, None
    # MATLAB's pixel centres are whole numbers from 1, ours are halves from 0.5.
    return focal * viewport, (x - 0.5, y - 0.5), (0.0, 0.0, distance)


def _number(entry: dict[str, Any], key: str) -> float | None:
    """One number, None where it is missing or empty."""
    value = entry.get(key)
    if not isinstance(value, list) or not value:
        return None
    number = value[0]
    if not isinstance(number, float) or not abs(number) < 1e9:
        raise ValueError(f"{key} is no number")
    return number


def as_matrix(rotation: Rotation) -> Matrix:
    """Rows of the (3, 3) matrix."""
    a, b, c = rotation.to_matrix().tolist()
    return tuple(a), tuple(b), tuple(c)
