"""cadpose: which CAD model is the object in this photo, and how is it turned?

from cadpose import Annotator

for annotation in Annotator().annotate("photo.jpg"):
    print(annotation.cad.name, annotation.pose.rotation, annotation.pose.focal_px)
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

if TYPE_CHECKING:
    from cadpose.errors import CadposeError
    from cadpose.geometry.boxes import Box
    from cadpose.library.catalogue import Library
    from cadpose.notebook import show
    from cadpose.pipeline import Annotator
    from cadpose.records import Annotation, CadModel, Detection, Photo, Pose4Dof, Rotation

# Imported on first use: `import cadpose` stays fast and pulls in none of the heavy packages.
_HOMES = {
    "Annotation": "cadpose.records",
    "Annotator": "cadpose.pipeline",
    "Box": "cadpose.geometry.boxes",
    "CadModel": "cadpose.records",
    "CadposeError": "cadpose.errors",
    "Detection": "cadpose.records",
    "Library": "cadpose.library.catalogue",
    "Photo": "cadpose.records",
    "Pose4Dof": "cadpose.records",
    "Rotation": "cadpose.records",
    "show": "cadpose.notebook",
}

__all__ = [
    "Annotation",
    "Annotator",
    "Box",
    "CadModel",
    "CadposeError",
    "Detection",
    "Library",
    "Photo",
    "Pose4Dof",
    "Rotation",
    "show",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'cadpose' has no attribute {name!r}")
    value: object = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *_HOMES])
