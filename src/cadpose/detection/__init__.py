"""Objects in photos: a detector, given boxes, and masks inside boxes, each behind a protocol."""

from __future__ import annotations

from typing import Protocol

from cadpose.records import Detection, Photo


class Detector(Protocol):
    """Finds the objects of a photo.

    Examples:
        >>> import numpy as np
        >>> from cadpose import Box, Detection, Photo
        >>> class Middle:
        ...     name = "middle"
        ...
        ...     def detect(self, photo):
        ...         w, h = photo.width, photo.height
        ...         return [Detection(Box(w / 4, h / 4, 3 * w / 4, 3 * h / 4), "car", source=self.name)]
        >>> Middle().detect(Photo(np.zeros((100, 200, 3), np.uint8)))[0].box
        Box(x0=50.0, y0=25.0, x1=150.0, y1=75.0)

        ``Annotator(detector=Middle())`` uses it.
    """

    name: str

    def detect(self, photo: Photo) -> list[Detection]:
        """Detections with library categories, best first; an empty list where nothing is found."""
        ...


class DetectionSource(Detector, Protocol):
    """A detector that tells what others found, of the photos that they looked at."""

    def knows(self, photo_name: str) -> bool:
        """Whether it was told anything of the photo of that name, be it that there is no object."""
        ...
