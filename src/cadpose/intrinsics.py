"""Which camera took a photo: told by the user, by a file, by the photo's EXIF, or unknown."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Self

from cadpose.errors import InputError
from cadpose.poses import PhotoCamera
from cadpose.records import Photo

#: Longest file that is read, in bytes.
MAX_BYTES = 64 << 20
#: The key of a camera that took all photos that a file does not name.
EVERY = "*"
_WAYS = "off, exif, FOCAL, FOCAL,X,Y or a JSON file"


@dataclass(frozen=True)
class Intrinsics:
    """Gives photos their cameras.

    Attributes:
        exif: Use EXIF's 35 mm equivalent where nothing else tells.
        every: (focal length, principal point or None for the photo's middle) in pixels, of all photos that
            ``by_photo`` does not name; None where nobody told.
        by_photo: The same by the photo's name, as it was given or without folders.
    """

    exif: bool = True
    every: tuple[float, tuple[float, float] | None] | None = None
    by_photo: Mapping[str, tuple[float, tuple[float, float] | None]] = field(default_factory=dict)

    @classmethod
    def from_text(cls, text: str) -> Self:
        """From what a user writes: ``off``, ``exif``, ``FOCAL``, ``FOCAL,X,Y`` in pixels, or a JSON file.

        The file holds an object: photo name, or ``"*"`` for all others, to ``{"focal_px": 1200.0,
        "principal_px": [640.0, 360.0]}``; the photo's middle is taken without ``principal_px``.

        Raises:
            InputError: it is none of these, or a number is none that a camera can have.
        """
        if text == "off":
            return cls(exif=False)
        if text == "exif":
            return cls()
        if text.lower().endswith(".json"):
            told = _read(Path(text))
            return cls(True, told.pop(EVERY, None), told)
        try:
            numbers = [float(part) for part in text.split(",")]
        except ValueError:
            numbers = []
        if len(numbers) not in (1, 3):
            raise InputError(f"{text!r} tells no camera: write {_WAYS}")
        principal = (numbers[1], numbers[2]) if len(numbers) == 3 else None
        return cls(True, _checked(numbers[0], principal, repr(text)))

    @property
    def name(self) -> str:
        """``off``, ``exif``, or ``given`` with a digest of what is given: annotations tell it."""
        if self.every is None and not self.by_photo:
            return "exif" if self.exif else "off"
        told = json.dumps([self.exif, self.every, sorted(self.by_photo.items())])
        return f"given-{hashlib.sha256(told.encode()).hexdigest()[:8]}"

    def camera_of(self, photo: Photo) -> PhotoCamera | None:
        """The photo's camera, None where nothing tells it."""
        name = Path(photo.name).name
        told = self.by_photo.get(photo.name) or self.by_photo.get(name) or self.every
        if told is not None:
            focal, principal = told
            return PhotoCamera(focal, principal or (photo.width / 2.0, photo.height / 2.0), "given")
        if self.exif and photo.focal_35mm:
            return PhotoCamera.from_35mm(photo.focal_35mm, photo.width, photo.height)
        return None


def _read(path: Path) -> dict[str, tuple[float, tuple[float, float] | None]]:
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}), name a file of cameras") from error
    if len(data) > MAX_BYTES:
        raise InputError(f"{path}: has more than {MAX_BYTES} bytes, no file of cameras has")
    try:
        content = json.loads(data)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON ({error}), see docs/alignment.md") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: must hold an object from photo names to cameras, see docs/alignment.md")
    return {str(name): _camera(entry, f"{path}: {name!r}") for name, entry in content.items()}


def _camera(entry: Any, where: str) -> tuple[float, tuple[float, float] | None]:
    if not isinstance(entry, dict) or not set(entry) <= {"focal_px", "principal_px"}:
        raise InputError(f"{where} must hold focal_px and perhaps principal_px, nothing else")
    focal, principal = entry.get("focal_px"), entry.get("principal_px")
    if isinstance(focal, bool) or not isinstance(focal, int | float):
        raise InputError(f"{where}: focal_px must be a number of pixels")
    if principal is None:
        return _checked(focal, None, where)
    numbers = isinstance(principal, list) and len(principal) == 2
    if not numbers or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in principal):
        raise InputError(f"{where}: principal_px must be [x, y] in pixels")
    return _checked(focal, (principal[0], principal[1]), where)


def _checked(
    focal: float, principal: tuple[float, float] | None, where: str
) -> tuple[float, tuple[float, float] | None]:
    try:
        focal = float(focal)  # an integer of JSON may be too large
        principal = principal and (float(principal[0]), float(principal[1]))
        PhotoCamera(focal, principal or (0.0, 0.0))
    except (ValueError, OverflowError) as error:
        raise InputError(f"{where} tells no camera: {error}") from error
    return focal, principal
