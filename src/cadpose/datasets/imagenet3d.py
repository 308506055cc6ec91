"""ImageNet3D (Ma et al., 2024): 200 classes in photos of ImageNet.

    annotations/<class>/<name>.npz    images/<class>/<name>.JPEG    lists/<class>_imagenet_{train,val}.txt

Each .npz holds one array ``annotations`` of dicts, stored as a pickle, which is read as data and never run.
Angles are in radians in PASCAL3D+'s convention; bbox, px, py, viewport, distance, cad_index, class,
object_status and dense are as the README of wufeim/imagenet3d says. Layout and the objects that are left out
(status_bad, no distance) follow that repository's preprocess_data.py, the projection its render_utils.py.
The files themselves have not been seen here.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.dataset import DataSet, category_of, is_published_test, require_split, rotation_of
from cadpose.datasets.files import inside, read_words
from cadpose.datasets.inert_pickle import read_object_array
from cadpose.datasets.label import Label
from cadpose.datasets.viewpoints import as_matrix
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.labels import from_pascal3d

SPLITS = ("train", "val")


@dataclass(frozen=True)
class _Photo:
    photo: Path
    file: Path
    split: str


def imagenet3d(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """ImageNet3D.

    ``status_partially`` and ``status_barely`` do not say whether the object is occluded or truncated: both
    make ``occluded`` true, the latter ``difficult`` as well.

    Args:
        root: The folder that holds annotations, images and lists.
        split: ``"train"`` or ``"val"``, None for both.
        published: In ``val`` only objects whose status is good.

    Raises:
        InputError: there is no such split, or the folder is no ImageNet3D.
    """
    require_split("imagenet3d", split, SPLITS)
    parts: list[_Photo] = []
    for part in SPLITS if split is None else (split,):
        ending = f"_imagenet_{part}.txt"
        for names in sorted((root / "lists").glob(f"*{ending}")):
            folder = names.name.removesuffix(ending)
            for name, *_ in read_words(names):
                photo = inside(root / "images" / folder, f"{name}.JPEG", names)
                parts.append(_Photo(photo, inside(root / "annotations" / folder, f"{name}.npz", names), part))
    if not parts:
        raise InputError(f"{root}: holds no photo of ImageNet3D, name the folder with lists and annotations")
    return DataSet("imagenet3d", parts, partial(_read, published=published))


def _read(part: _Photo, published: bool) -> Iterator[Label]:
    for number, entry in enumerate(read_object_array(part.file, "annotations")):
        where = f"{part.file}: object {number}"
        if not isinstance(entry, dict):
            raise InputError(f"{where} is no dict")
        status = entry.get("object_status")
        if status is None or status == "status_bad" or "px" not in entry:
            continue
        try:
            label = _label(entry, part, status)
        except (KeyError, TypeError) as error:
            raise InputError(f"{where} lacks {error} or holds another type") from error
        except (ValueError, OverflowError) as error:
            raise InputError(f"{where}: {error}") from error
        if label is not None and (not published or part.split == "train" or is_published_test(label)):
            yield label


def _label(entry: dict[str, Any], part: _Photo, status: Any) -> Label | None:
    distance = _number(entry, "distance")
    if distance <= 0.0:
        return None
    azimuth, elevation, theta = (np.rad2deg(_number(entry, key)) for key in ("azimuth", "elevation", "theta"))
    rotation = rotation_of(*from_pascal3d(azimuth, (elevation + 180.0) % 360.0 - 180.0, theta))
    bbox = entry["bbox"]
    if not isinstance(bbox, list) or len(bbox) != 4:
        raise ValueError("bbox must hold four numbers")
    name = entry["class"]
    if not isinstance(name, str) or not name:
        raise ValueError("class must be a word")
    cad = int(_number(entry, "cad_index"))
    # The projection multiplies by the viewport alone; focal is 1 throughout.
    focal_px = _number(entry, "viewport")
    return Label(
        photo=part.photo,
        category=category_of(name),
        box=Box(*(float(v) for v in bbox)),
        cad=f"imagenet3d/{name}/{cad:02d}",
        azimuth=rotation.azimuth,
        elevation=rotation.elevation,
        inplane=rotation.inplane,
        focal_px=focal_px,
        principal_px=(_number(entry, "px"), _number(entry, "py")),
        R_cv_from_s=as_matrix(rotation),
        t_cv=(0.0, 0.0, distance),
        split=part.split,
        occluded=status in ("status_partially", "status_barely"),
        difficult=status == "status_barely",
        source="imagenet3d",
    )


def _number(entry: dict[str, Any], key: str) -> float:
    value = entry[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e9:
        raise ValueError(f"{key} is no number")
    return float(value)
