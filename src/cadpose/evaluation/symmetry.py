"""Which symmetry a label's rotation errors are taken modulo."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from cadpose.datasets.labels import Label
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.library.symmetry import category_symmetry

Symmetry = Literal["none", "cad", "category"]


def label_symmetry(library: Library, source: Symmetry) -> Callable[[Label], SymmetryGroup | None]:
    """The symmetry of labelled objects; None says that errors are plain.

    Args:
        library: Where the labels' CAD models are looked up.
        source: ``none``: plain errors. ``cad``: the labelled CAD model's; plain errors where the library has
            none of that name. ``category``: for those what is usual in their category.

    Returns:
        A function of a label. It raises LibraryError where the model's file is damaged.
    """
    known = {model.id for model in library.models()}

    def of(label: Label) -> SymmetryGroup | None:
        if source == "none":
            return None
        if label.cad in known:
            return library.symmetry(label.cad)
        return category_symmetry(label.category) if source == "category" else None

    return of
