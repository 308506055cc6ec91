"""Which object of a photo goes, and which CAD model comes, as a user names them."""

from __future__ import annotations

from collections.abc import Sequence

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.records import Annotation, CadModel

_SHOWN = 4


def model_named(library: Library, text: str) -> CadModel:
    """The model of that id or of that name, whatever its letters' case.

    Raises:
        LibraryError: there is none; the message names close ids.
        InputError: several models have that name.
    """
    wanted = text.strip().lower()
    models = library.models()
    exact = [model for model in models if model.id == text]
    named = exact or [model for model in models if wanted in (model.id.lower(), model.name.lower())]
    if not named:
        return library.get(text)
    if len(named) > 1:
        ids = ", ".join(f"{model.id} ({model.category})" for model in named[:_SHOWN])
        more = f" and {len(named) - _SHOWN} more" if len(named) > _SHOWN else ""
        raise InputError(f"{len(named)} models are called {text!r}: name one by its id: {ids}{more}")
    return named[0]


def chosen_object(
    annotations: Sequence[Annotation], photo: str, number: int | None = None, category: str | None = None
) -> Annotation:
    """The object of that number (from 1), or the largest one, of that category where one is told.

    Raises:
        InputError: there is no such object.
    """
    if not annotations:
        raise InputError(f"no object was found in {photo}: give its box and category to `cadpose annotate`")
    told = ", ".join(f"{i} {a.detection.category}" for i, a in enumerate(annotations, 1))
    if number is not None:
        if not 1 <= number <= len(annotations):
            raise InputError(f"{photo} has no object {number}: its objects are {told}")
        found = annotations[number - 1]
        if category is not None and found.detection.category != category:
            raise InputError(f"object {number} of {photo} is no {category}: its objects are {told}")
        return found
    chosen = [a for a in annotations if category in (None, a.detection.category)]
    if not chosen:
        raise InputError(f"no {category} was found in {photo}: its objects are {told}")
    return max(chosen, key=_pixels)


def _pixels(annotation: Annotation) -> float:
    mask, box = annotation.detection.mask, annotation.detection.box
    return float(mask.sum()) if mask is not None else box.width * box.height
