"""Pix3D (Sun et al., CVPR 2018): photos of furniture with the exact model, its pose, and a mask.

``pix3d.json`` is an array; each entry has img, category, img_size, bbox, mask, model, rot_mat, trans_mat,
focal_length, cam_position, truncated, occluded and slightly_occluded. Pix3D has no splits of its own.

Its rotation is that of the camera which took the whole photo: it is kept in ``R_cv_from_s``, exact together
with ``K`` and ``t_cv``. Azimuth, elevation and in-plane rotation are those of that camera turned to look
straight at the model's origin. They are what the project's own camera model needs, where the origin lies on
the optical axis, and what PASCAL3D+ and its followers label; Pix3D's authors compute the first two alike.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.dataset import DataSet, category_of, is_published_test, require_split
from cadpose.datasets.files import inside, read_json
from cadpose.datasets.label import Label
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.labels import from_pix3d
from cadpose.geometry.sight import allocentric_rotation
from cadpose.records import Rotation

#: Largest side of a photo that an entry may claim.
MAX_SIDE = 100_000


def pix3d(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """Pix3D.

    Args:
        root: The folder that holds pix3d.json, img, mask and model.
        split: None; there are no splits.
        published: Only objects that are neither truncated nor occluded, not even slightly.

    Raises:
        InputError: a split was asked for, or the folder is no Pix3D.
    """
    require_split("pix3d", split, ())
    file = root / "pix3d.json"
    entries = read_json(file)
    if not isinstance(entries, list) or not entries:
        raise InputError(f"{file}: expected an array of Pix3D's labels")
    return DataSet("pix3d", list(enumerate(entries)), partial(_read, file=file, published=published))


def _read(part: tuple[int, Any], file: Path, published: bool) -> Iterator[Label]:
    number, entry = part
    where = f"{file}: entry {number}"
    if not isinstance(entry, dict):
        raise InputError(f"{where} is no object")
    try:
        label = _label(entry, file)
    except (KeyError, TypeError) as error:
        raise InputError(f"{where} lacks {error} or holds another type") from error
    except (ValueError, OverflowError) as error:
        raise InputError(f"{where}: {error}") from error
    if not published or is_published_test(label):
        yield label


def _label(entry: dict[str, Any], file: Path) -> Label:
    root = file.parent
    width, height = (int(v) for v in _numbers(entry, "img_size", (2,)))
    if not (1 <= width <= MAX_SIDE and 1 <= height <= MAX_SIDE):
        raise ValueError(f"img_size {width} x {height} is no size of a photo")
    focal_mm = float(_numbers(entry, "focal_length", ()))
    if focal_mm <= 0:
        raise ValueError(f"focal_length {focal_mm} must be above 0")
    camera = from_pix3d(
        _numbers(entry, "rot_mat", (3, 3)),
        _numbers(entry, "trans_mat", (3,)),
        focal_mm,
        (width, height),
        _numbers(entry, "cam_position", (3,)),
    )
    box = Box(*_numbers(entry, "bbox", (4,)).tolist())
    x, y, z = camera.t_cv.tolist()
    if z <= 0:
        raise ValueError(f"trans_mat puts the object at depth {z}, it must lie before the camera")
    origin = camera.principal_px + camera.focal_px * np.array([x / z, y / z])
    turned = allocentric_rotation(camera.R_cv_from_s, origin, camera.focal_px, camera.principal_px)
    rotation = Rotation.from_matrix(turned)
    a, b, c = camera.R_cv_from_s.tolist()
    category, model = _text(entry, "category"), _text(entry, "model")
    return Label(
        photo=inside(root, _text(entry, "img"), file),
        category=category_of(category),
        box=box,
        cad=f"pix3d/{model}",
        cad_path=inside(root, model, file),
        azimuth=rotation.azimuth,
        elevation=rotation.elevation,
        inplane=rotation.inplane,
        mask=inside(root, _text(entry, "mask"), file),
        focal_px=camera.focal_px,
        principal_px=camera.principal_px,
        R_cv_from_s=(tuple(a), tuple(b), tuple(c)),
        t_cv=(x, y, z),
        truncated=_flag(entry, "truncated"),
        occluded=_flag(entry, "occluded") or _flag(entry, "slightly_occluded"),
        source="pix3d",
    )


def _numbers(entry: dict[str, Any], key: str, shape: tuple[int, ...]) -> Any:
    value = np.asarray(entry[key])
    if value.dtype.kind not in "if" or value.shape != shape or not np.isfinite(value).all():
        raise ValueError(f"{key} must hold {' x '.join(map(str, shape)) or 'one'} finite numbers")
    return value.astype(np.float64)


def _text(entry: dict[str, Any], key: str) -> str:
    value = entry[key]
    if not isinstance(value, str) or not value:
        raise ValueError(f"{key} must be a word")
    return value


def _flag(entry: dict[str, Any], key: str) -> bool:
    value = entry.get(key, False)
    if not isinstance(value, bool):
        raise ValueError(f"{key} must be true or false")
    return value
