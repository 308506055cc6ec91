"""Which reader a data set of boxes or masks needs, told by what lies at its path."""

from __future__ import annotations

from pathlib import Path

from cadpose.datasets.files import read_json
from cadpose.datasets.labels import JSONL_SUFFIXES, read_labels
from cadpose.datasets.pix3d import pix3d
from cadpose.datasets.scenes import SceneSet
from cadpose.datasets.scenes_coco import coco_scenes
from cadpose.datasets.scenes_labels import label_scenes
from cadpose.datasets.scenes_yolo import is_yolo, yolo_scenes
from cadpose.errors import InputError

#: Files by which folders are known.
_SYNTH, _PIX3D = "labels.jsonl", "pix3d.json"


def open_scenes(path: Path, images: Path | None = None) -> SceneSet:
    """A data set of photos in which every object of its categories is labelled.

    Args:
        path: A label file of ours (JSONL, or a JSON array), a file in COCO's JSON, a folder with YOLO's
            ``images`` and ``labels``, one of Pix3D with ``pix3d.json``, or one of ``cadpose synth``.
        images: Folder of the photos of a COCO file; that of the file unless told.

    Raises:
        InputError: there is no such file or folder, nothing says what it is, or it cannot be used.
    """
    if not path.exists():
        raise InputError(f"{path}: there is no such file or folder, check the path")
    if path.is_dir():
        found = _folder(path)
    elif path.suffix.lower() in JSONL_SUFFIXES:
        found = label_scenes(read_labels(path), "labels", _name(path))
    else:
        content = read_json(path)
        if isinstance(content, dict):
            return coco_scenes(path, images, content)
        found = label_scenes(read_labels(path), "labels", _name(path))
    if images is not None:
        raise InputError(
            f"{path}: its photos are named by its labels, leave out --images, which is for COCO's JSON"
        )
    return found


def _folder(root: Path) -> SceneSet:
    if (root / _PIX3D).is_file():
        return label_scenes(pix3d(root), "pix3d", root.resolve().name)
    if is_yolo(root):
        return yolo_scenes(root)
    if (root / _SYNTH).is_file():
        return label_scenes(read_labels(root / _SYNTH), "labels", _name(root / _SYNTH))
    raise InputError(
        f"{root}: holds none of {_PIX3D}, {_SYNTH}, or the folders images and labels; "
        "for COCO's JSON name the file itself"
    )


def _name(path: Path) -> str:
    return f"{path.resolve().parent.name}/{path.name}"
