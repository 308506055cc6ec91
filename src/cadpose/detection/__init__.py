"""Objects in photos: a detector, given boxes, and masks inside boxes, each behind a protocol."""

from __future__ import annotations

from typing import Protocol

from cadpose.records import Detection, Photo


class Detector(Protocol):
    """Finds the objects of a photo."""

    name: str

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections with library categories, best first; an empty list where nothing is found."""
        ...


class DetectionSource(Detector, Protocol):
    """A detector that tells what others found, of the photos that they looked at."""

    def knows(self, photo_name: str) -> bool:
        """Whether it was told anything of the photo of that name, be it that there is no object."""
        ...
