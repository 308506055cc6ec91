"""The objects that a user draws, in place of a detector."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from cadpose.detection.given import Polygon, given_detections
from cadpose.detection.mask_png import read_masks
from cadpose.errors import InputError
from cadpose.geometry.boxes import Box
from cadpose.records import Detection, Mask, Photo, Rotation


class DrawnObjects:
    """Boxes, polygons and masks that hold for whatever photo is asked about; a detector like any other.

    Args:
        boxes: Rectangles in pixels of the photo.
        polygons: Outlines in pixels of the photo.
        masks: PNG files of the photo's size.
        categories: One an object, boxes first, then polygons, then masks; one for all, or none.
        rotations: One an object, one for all, or none.
    """

    name = "user"

    def __init__(
        self,
        boxes: Sequence[Box] = (),
        polygons: Sequence[Polygon] = (),
        masks: Sequence[Path] = (),
        categories: Sequence[str] = (),
        rotations: Sequence[Rotation] = (),
    ) -> None:
        self.boxes, self.polygons, self.masks = boxes, polygons, masks
        self.categories, self.rotations = categories, rotations

    def detect(self, photo: Photo) -> list[Detection]:
        """The objects in that photo.

        Raises:
            InputError: one does not fit the photo, there are too many masks, or the numbers do not fit.
        """
        masks: list[Mask] = []
        for path in self.masks:
            found = read_masks(path, photo, before=len(self.polygons) + len(masks))
            if not found:
                raise InputError(f"{path} shows no object: all of its pixels are 0.")
            masks += found
        return given_detections(
            photo, self.boxes, self.categories, self.rotations, polygons=self.polygons, masks=masks
        )

    def knows(self, photo_name: str) -> bool:
        """Always."""
        return True
