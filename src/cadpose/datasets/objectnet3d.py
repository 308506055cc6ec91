"""ObjectNet3D (Xiang et al., ECCV 2016): a hundred classes in photos of ImageNet.

    Annotations/<name>.mat    Images/<name>.JPEG    Image_sets/{train,val,test}.txt

The .mat files are laid out as those of PASCAL3D+; azimuths below 0 occur and are wrapped.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

from cadpose.datasets.dataset import DataSet, require_split
from cadpose.datasets.files import inside, read_words
from cadpose.datasets.viewpoints import Annotated, read_annotated
from cadpose.errors import InputError

SPLITS = ("train", "val", "test")


def objectnet3d(root: Path, split: str | None = None, published: bool = False) -> DataSet:
    """ObjectNet3D; photos that a list names but nobody annotated are left out, as published loaders do.

    Args:
        root: The folder that holds Annotations, Images and Image_sets.
        split: ``"train"``, ``"val"`` or ``"test"``, None for all.
        published: Only what published figures count, see `read_annotated`.

    Raises:
        InputError: there is no such split, or the folder is no ObjectNet3D.
    """
    require_split("objectnet3d", split, SPLITS)
    parts: list[Annotated] = []
    for part in SPLITS if split is None else (split,):
        names = root / "Image_sets" / f"{part}.txt"
        if split is None and not names.exists():
            continue
        for name, *_ in read_words(names):
            file = inside(root / "Annotations", f"{name}.mat", names)
            if file.exists():
                parts.append(Annotated(inside(root / "Images", f"{name}.JPEG", names), file, part))
    if not parts:
        raise InputError(f"{root}: holds no photo of ObjectNet3D, name the folder with Image_sets")
    return DataSet("objectnet3d", parts, partial(read_annotated, source="objectnet3d", published=published))
