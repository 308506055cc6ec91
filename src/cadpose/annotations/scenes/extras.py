"""What a scene file says beside its geometry: the annotations, and whom to thank for the models."""

from __future__ import annotations

import re
from typing import Any

from cadpose import __version__
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.pose_parts import pose_json
from cadpose.annotations.scenes.layout import PlacedModel, diagonal_metres

#: The key under which readers find all of it.
KEY = "cadpose"
GENERATOR = f"cadpose {__version__}"


def credits(document: AnnotationDocument) -> str:
    """One line: each model with its creator and licence, and whose photo it is not ours to say."""
    told = dict.fromkeys(
        f"{part.cad.name or part.cad.id} by {part.cad.creator or 'an unknown creator'}"
        f" ({part.cad.licence or 'unknown licence'})"
        for part in document.annotations
    )
    models = f"CAD models: {'; '.join(told)}. " if told else ""
    return f"{models}Photo: {photo_title(document)}, rights with its owner."


def photo_title(document: AnnotationDocument) -> str:
    """The photo's file name without its folders."""
    return re.split(r"[/\\]", document.photo.name)[-1] or "photo"


def model_extras(model: PlacedModel) -> dict[str, Any]:
    """What the node of one model says, in JSON's types."""
    annotation, cad = model.annotation, model.annotation.cad
    return {
        "annotation": model.number,
        "category": annotation.detection.category,
        "cad": {
            "id": cad.id,
            "name": cad.name,
            "licence": cad.licence,
            "creator": cad.creator,
            "source": cad.source,
            "sha256": cad.sha256,
        },
        "pose": pose_json(annotation.pose),
        "metres_per_diagonal": diagonal_metres(annotation),
        "stretch": list(model.stretch),
    }


def unit_told(models: tuple[PlacedModel, ...]) -> str:
    """In what unit the scene is."""
    known = [diagonal_metres(model.annotation) is not None for model in models]
    if all(known):
        return "metres" if known else "none: a photo without models"
    if any(known):
        return "metres; a model of unknown size has a bounding-box diagonal of 1"
    return "bounding-box diagonals: no model's size is known"
