"""The objects that a user tells in place of a detector, as words that can be handed to another process."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from pathlib import Path

from cadpose.batch.photo_files import file_mark, photo_digest
from cadpose.detection import DetectionSource
from cadpose.detection.drawn import DrawnObjects
from cadpose.detection.given import parse_box, parse_polygon, parse_rotation
from cadpose.detection.sources import open_detections


@dataclass(frozen=True)
class ToldObjects:
    """Boxes, outlines and masks that hold for whatever photo, or a file that names the photos.

    Attributes:
        boxes: ``"x0,y0,x1,y1"``.
        polygons: ``"x,y x,y x,y"``.
        masks: PNG files.
        categories: One an object, one for all, or none; of a file, what to keep.
        rotations: ``"azimuth,elevation,inplane"``, one an object, one for all, or none.
        file: COCO JSON, Label Studio's JSON, or a folder of PNG masks; then without the others.
    """

    boxes: tuple[str, ...] = ()
    polygons: tuple[str, ...] = ()
    masks: tuple[Path, ...] = ()
    categories: tuple[str, ...] = ()
    rotations: tuple[str, ...] = ()
    file: Path | None = None

    @property
    def by_name(self) -> bool:
        """What is told depends on the photo's name."""
        return self.file is not None

    def open(self) -> DetectionSource:
        """What tells the objects of a photo.

        Raises:
            InputError: the words are no numbers, or the file cannot be used.
        """
        if self.file is not None:
            return open_detections(self.file, self.categories or None)
        return DrawnObjects(
            [parse_box(text) for text in self.boxes],
            [parse_polygon(text) for text in self.polygons],
            self.masks,
            self.categories,
            [parse_rotation(text) for text in self.rotations],
        )

    def digest(self) -> str:
        """Of all that is told, files included; those of a folder by their names, sizes and times."""
        told = asdict(self)
        told["masks"] = [photo_digest(path) for path in self.masks]
        if self.file is not None and self.file.is_dir():
            told["file"] = [(path.name, *file_mark(path)) for path in sorted(self.file.iterdir())]
        elif self.file is not None:
            told["file"] = photo_digest(self.file)
        return hashlib.sha256(json.dumps(told).encode()).hexdigest()
