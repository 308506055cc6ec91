"""BOP (Hodaň et al., ECCV 2018; bop.felk.cvut.cz): photos with the exact model and pose of every object.

    models/obj_000001.ply            models/models_info.json
    <split>/<scene>/scene_gt.json    <split>/<scene>/scene_camera.json    <split>/<scene>/scene_gt_info.json
    <split>/<scene>/rgb/000000.png   <split>/<scene>/mask_visib/000000_000000.png

as its ``docs/bop_datasets_format.md`` describes them. Splits are folders called train, val or test, perhaps
with an ending: ``train_pbr``. Lengths are millimetres. Models have z up and no agreed front: +y is taken for
it, so that a model turned to ShapeNet's axes is (x, z, -y). Angles are those of the camera turned to look
straight at the model's origin, as with Pix3D. K is taken as it stands: BOP does not say whether pixels'
centres are whole numbers; its toolkit's renderers take them for halves, as everything here does.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.dataset import DataSet, category_of
from cadpose.datasets.files import read_json
from cadpose.datasets.label import Label, Matrix, Vector
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.geometry.frames import FloatArray, R_b_from_s
from cadpose.geometry.sight import allocentric_rotation
from cadpose.records import Rotation

SPLITS = ("train", "val", "test")
#: Front and up of a model file, as ``--front`` and ``--up`` of `cadpose library add` name them.
AXES = ("+y", "+z")
#: By how much the two focal lengths of K may differ, as a share.
SQUARE_TOLERANCE = 0.01
#: Below this visible share BOP's evaluation leaves an object out, and below that we call it occluded.
_LEAST_VISIBLE, _UNOCCLUDED = 0.1, 0.9
_ENDINGS = (".png", ".jpg", ".jpeg", ".tif")


@dataclass(frozen=True)
class _Scene:
    folder: Path
    split: str


def bop(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """A data set in BOP's format; a scene is one part.

    Args:
        root: The folder that holds models and the splits.
        split: ``"train"``, ``"val"``, ``"test"``, or a folder's whole name; None for all.
        published: Only objects of which a tenth is visible, as BOP's evaluation counts.

    Raises:
        InputError: there is no such split, or the folder is no BOP data set.
    """
    folders = sorted(p for p in root.glob("*") if p.is_dir() and p.name.split("_")[0] in SPLITS)
    scenes = [
        _Scene(scene.parent, folder.name.split("_")[0])
        for folder in folders
        if split in (None, folder.name, folder.name.split("_")[0])
        for scene in sorted(folder.glob("*/scene_gt.json"))
    ]
    if split is not None and not scenes and folders:
        raise InputError(f"bop has no split {split!r} here: it has {', '.join(f.name for f in folders)}")
    if not scenes:
        raise InputError(
            f"{root}: holds no scene of BOP, name the folder with models and test (or train, val)"
        )
    models = _models(root)
    return DataSet("bop", scenes, partial(_read, root=root, models=models, published=published))


def _models(root: Path) -> Path:
    """The folder of the models; those that are there for evaluation only come last."""
    found = sorted(root.glob("models*/models_info.json"), key=lambda p: (p.parent.name.endswith("_eval"), p))
    if not found:
        raise InputError(f"{root}: holds no models/models_info.json, get the data set's models too")
    return found[0].parent


def _read(scene: _Scene, root: Path, models: Path, published: bool) -> Iterator[Label]:
    infos = _table(models / "models_info.json")
    poses, cameras = (_table(scene.folder / f"scene_{name}.json") for name in ("gt", "camera"))
    more = scene.folder / "scene_gt_info.json"
    seen = _table(more) if more.is_file() else {}
    for image, objects in poses.items():
        where = f"{scene.folder / 'scene_gt.json'}: image {image[:20]}"
        if not (image.isascii() and image.isdigit() and len(image) <= 9 and isinstance(objects, list)):
            raise InputError(f"{where} is no list of objects under a number")
        photo = _photo(scene.folder, int(image))
        for number, told in enumerate(objects):
            try:
                visible = seen[image][number] if seen else {}
                label = _label(scene, photo, int(image), number, told, cameras[image], visible, models, infos)
            except (KeyError, IndexError, TypeError) as error:
                raise InputError(f"{where}, object {number} lacks {error} or holds another type") from error
            except (ValueError, OverflowError) as error:
                raise InputError(f"{where}, object {number}: {error}") from error
            if not (published and label.difficult):
                yield label


def _label(
    scene: _Scene,
    photo: Path,
    image: int,
    number: int,
    told: dict[str, Any],
    camera: dict[str, Any],
    visible: dict[str, Any],
    models: Path,
    infos: dict[str, Any],
) -> Label:
    if not all(isinstance(part, dict) for part in (told, camera, visible)):
        raise ValueError("it, its camera or what is told of its visible part is no JSON object")
    R_cv_from_s = _numbers(told, "cam_R_m2c", (3, 3)) @ R_b_from_s
    t_cv = _numbers(told, "cam_t_m2c", (3,))
    if t_cv[2] <= 0:
        raise ValueError(f"cam_t_m2c puts the object at depth {t_cv[2]}, it must lie before the camera")
    focal, principal = _camera(_numbers(camera, "cam_K", (3, 3)))
    origin = principal + focal * t_cv[:2] / t_cv[2]
    turned = allocentric_rotation(R_cv_from_s, origin, focal, principal)
    rotation = Rotation.from_matrix(turned)
    key = int(told["obj_id"])
    info = infos[str(key)]
    if not isinstance(info, dict):
        raise ValueError(f"models_info.json tells of model {key} what is no JSON object")
    name = f"obj_{key:06d}"
    fraction = float(visible.get("visib_fract", 1.0))
    mask = scene.folder / "mask_visib" / f"{image:06d}_{number:06d}.png"
    return Label(
        photo=photo,
        category=category_of(_word(info, "category") or name),
        box=_box(visible),
        cad=_word(info, "cad_id") or f"bop/{models.parent.name}/{name}",
        cad_path=models / f"{name}.ply",
        cad_axes=AXES,
        cad_diagonal=float(np.linalg.norm([_numbers(info, f"size_{axis}", ()) for axis in "xyz"])),
        azimuth=rotation.azimuth,
        elevation=rotation.elevation,
        inplane=rotation.inplane,
        mask=mask if mask.is_file() else None,
        focal_px=focal,
        principal_px=(float(principal[0]), float(principal[1])),
        R_cv_from_s=_rows(R_cv_from_s),
        t_cv=_vector(t_cv),
        split=scene.split,
        occluded=fraction < _UNOCCLUDED,
        difficult=fraction < _LEAST_VISIBLE,
        source="bop",
    )


def _photo(folder: Path, image: int) -> Path:
    for kind in ("rgb", "gray"):
        for ending in _ENDINGS:
            path = folder / kind / f"{image:06d}{ending}"
            if path.is_file():
                return path
    raise InputError(f"{folder / 'rgb'}: holds no picture {image:06d}, get the whole data set")


def _camera(K: FloatArray) -> tuple[float, FloatArray]:
    (fx, skew, x), (zero, fy, y), last = K.tolist()
    if skew or zero or last != [0.0, 0.0, 1.0] or fx <= 0:
        raise ValueError("cam_K must be [[f, 0, x], [0, f, y], [0, 0, 1]]")
    if abs(fx - fy) > SQUARE_TOLERANCE * fx:
        raise ValueError(f"cam_K has the focal lengths {fx} and {fy}, only square pixels are supported")
    return (fx + fy) / 2.0, np.array([x, y])


def _box(visible: dict[str, Any]) -> Box | None:
    """The visible part's rectangle; None where it is not told, or nothing is visible."""
    for key in ("bbox_visib", "bbox_obj"):
        if key in visible:
            x, y, width, height = _numbers(visible, key, (4,)).tolist()
            return Box.from_xywh(x, y, width, height) if width > 0 and height > 0 else None
    return None


def _word(info: dict[str, Any], key: str) -> str | None:
    value = info.get(key)
    return value if isinstance(value, str) and value else None


def _numbers(entry: dict[str, Any], key: str, shape: tuple[int, ...]) -> Any:
    value = np.asarray(entry[key])
    size = int(np.prod(shape, dtype=int))
    if value.dtype.kind not in "if" or value.size != size or not np.isfinite(value).all():
        raise ValueError(f"{key} must hold {size} finite numbers")
    return value.astype(np.float64).reshape(shape)


def _rows(R: FloatArray) -> Matrix:
    a, b, c = R.tolist()
    return tuple(a), tuple(b), tuple(c)


def _vector(t: FloatArray) -> Vector:
    x, y, z = t.tolist()
    return x, y, z


def _table(path: Path) -> dict[str, Any]:
    told = read_json(path)
    if not isinstance(told, dict):
        raise InputError(f"{path}: expected an object by number, found {type(told).__name__}")
    return told
