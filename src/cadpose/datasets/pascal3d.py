"""PASCAL3D+ release 1.1 (Xiang et al., WACV 2014): twelve classes in photos of PASCAL VOC and ImageNet.

    Annotations/<class>_pascal/<name>.mat      Images/<class>_pascal/<name>.jpg
    Annotations/<class>_imagenet/<name>.mat    Images/<class>_imagenet/<name>.JPEG
    PASCAL/VOCdevkit/VOC2012/ImageSets/Main/<class>_val.txt

The split is the published one (PoseContrast, PoseFromShape, StarMap): PASCAL VOC's validation photos are
``val``, all others, with every photo of ImageNet, are ``train``.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from cadpose.datasets.dataset import DataSet, require_split
from cadpose.datasets.files import read_words
from cadpose.datasets.viewpoints import Annotated, read_annotated
from cadpose.errors import InputError
from cadpose.photos import SUFFIXES

CLASSES = (
    "aeroplane", "bicycle", "boat", "bottle", "bus", "car", "chair", "diningtable", "motorbike", "sofa",
    "train", "tvmonitor",
)  # fmt: skip
SPLITS = ("train", "val")
_VOC_LISTS = Path("PASCAL", "VOCdevkit", "VOC2012", "ImageSets", "Main")


def pascal3d(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """PASCAL3D+; classes that are not there are left out.

    Args:
        root: The folder that holds Annotations, Images and PASCAL.
        split: ``"train"`` or ``"val"``, None for both.
        published: Only what published figures count, see `read_annotated`.

    Raises:
        InputError: there is no such split, or the folder is no PASCAL3D+.
    """
    require_split("pascal3d", split, SPLITS)
    parts: list[Annotated] = []
    for name in CLASSES:
        for database in ("imagenet", "pascal"):
            photos = root / "Images" / f"{name}_{database}"
            if not photos.is_dir():
                continue
            held_out = _validation(root, name) if database == "pascal" else set()
            for photo in sorted(p for p in photos.iterdir() if p.suffix.lower() in SUFFIXES):
                belongs_to = "val" if photo.stem in held_out else "train"
                file = root / "Annotations" / photos.name / f"{photo.stem}.mat"
                if split in (None, belongs_to):
                    parts.append(Annotated(photo, file, belongs_to, name))
    if not parts:
        raise InputError(f"{root}: holds no photo of PASCAL3D+, name the folder with Annotations and Images")
    return DataSet("pascal3d", parts, partial(read_annotated, source="pascal3d", published=published))


def _validation(root: Path, name: str) -> set[str]:
    """Photos of PASCAL VOC's validation list; its lines are a name and 1, 0 or -1."""
    return {words[0] for words in read_words(root / _VOC_LISTS / f"{name}_val.txt")}
