"""A file or folder of others' detections to the reader that fits, by what it holds."""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Collection
from pathlib import Path

from cadpose.detection import DetectionSource
from cadpose.detection.coco_json import FileDetector
from cadpose.detection.label_studio import LabelStudioDetector
from cadpose.detection.mask_folder import MaskFolder
from cadpose.detection.reading import read_start
from cadpose.errors import InputError
from cadpose.library.class_map import category_or_word

_KINDS = "COCO JSON, a JSON export of Label Studio, or a folder of PNG masks"


def open_detections(path: Path | str, categories: Collection[str] | None = None) -> DetectionSource:
    """What reads the detections there: a folder of PNG masks, COCO JSON or Label Studio's export.

    Args:
        path: The file or folder.
        categories: What to keep, by library category or another word for it; None keeps all but people,
            animals and food. Masks that tell no category get the one that is named.

    Raises:
        InputError: it is none of these, or cannot be used; one sentence names it and the mend.
    """
    path = Path(path)
    # The words of the files are mapped alike.
    wanted = None if categories is None else [category_or_word(word) for word in categories]
    if path.is_dir():
        return MaskFolder(path, wanted)
    start = read_start(path, 4096, _KINDS).removeprefix(BOM_UTF8)
    if start.startswith(b"\x89PNG"):
        raise InputError(
            f"{path} is a picture: name the folder of the masks, or give one photo's mask with --mask."
        )
    text = start.lstrip()
    if text.startswith(b"{"):
        return FileDetector(path, wanted)
    if text.startswith(b"["):
        return LabelStudioDetector(path, wanted)
    raise InputError(f"{path} is not a detections file: name {_KINDS}.")
