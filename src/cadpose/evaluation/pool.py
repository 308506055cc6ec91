"""Which CAD models vote on a labelled object's rotation: whether its own is among them decides much."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from cadpose.datasets.labels import Label
from cadpose.errors import InputError, LibraryError
from cadpose.library.catalogue import Library
from cadpose.records import CadModel

Pool = Literal["usual", "with-true", "without-true"]


def label_pool(
    library: Library, kind: Pool, candidates: int
) -> Callable[[Label], tuple[CadModel, ...] | None]:
    """The models that vote on a label's object; None leaves the choice to the annotator.

    Args:
        library: Where the labels' CAD models are.
        kind: ``usual``: the category's representatives, as for any photo. ``with-true``: the labelled model
            is one of them. ``without-true``: it is none of them.
        candidates: How many models vote at most.

    Returns:
        A function of a label. It raises InputError where the label names no model of the library, and
        LibraryError where its category has no other model.
    """

    def of(label: Label) -> tuple[CadModel, ...] | None:
        if kind == "usual":
            return None
        if label.cad is None:
            raise InputError(f"{label.photo}: the label names no CAD model, use --pool usual")
        true = library.get(label.cad)
        if true.category != label.category:
            raise InputError(
                f"{label.photo}: a {label.category} by its label, but {true.id} is a {true.category}"
            )
        others = [m for m in library.representatives(label.category, candidates + 1) if m.id != true.id]
        if kind == "with-true":
            return (true, *others[: candidates - 1])
        if not others:
            raise LibraryError(f"the library has no {label.category} beside {true.id}")
        return tuple(others[:candidates])

    return of
