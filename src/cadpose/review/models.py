"""The opened CAD library as the page sees it: models by digest, by id, and in order of their names."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from cadpose.errors import LibraryError
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel
from cadpose.review.shapes import CadShape

#: Rotations of a model's symmetry that are told, and steps of a whole turn where any turn is one.
MOST_TWINS, STEPS = 24, 8


class Models:
    """Models of a library, or of none.

    Args:
        library: It; None where none could be opened.
        why: The sentence why.
    """

    def __init__(self, library: Library | None, why: str = "") -> None:
        self.library, self.why = library, why

    @cached_property
    def _by_id(self) -> dict[str, CadModel]:
        return {} if self.library is None else {model.id: model for model in self.library.models()}

    @cached_property
    def _by_key(self) -> dict[str, CadModel]:
        return {model.sha256: model for model in reversed(self._by_id.values())}

    @cached_property
    def _in_order(self) -> list[tuple[CadModel, str]]:
        """Models by name, each with what a search looks at."""
        models = sorted(self._by_id.values(), key=lambda m: (m.name.casefold(), m.id))
        return [(m, f"{m.name}\n{m.category}\n{m.id}\n{m.creator}".casefold()) for m in models]

    @cached_property
    def _place(self) -> dict[str, int]:
        return {model.id: place for place, (model, _) in enumerate(self._in_order)}

    def opened(self) -> Library:
        """The library.

        Raises:
            LibraryError: there is none; the sentence says why.
        """
        if self.library is None:
            raise LibraryError(self.why or "there is no CAD library")
        return self.library

    def has(self, cad: CadModel) -> bool:
        """Whether the library has this very model."""
        held = self._by_id.get(cad.id)
        return held is not None and (not cad.sha256 or held.sha256 == cad.sha256)

    def shape(self, cad: CadModel) -> CadShape:
        """As the page gets it."""
        held = self._by_id.get(cad.id)
        if held is None or not self.has(cad):
            return CadShape.of(cad, False)
        return CadShape.of(held if not cad.sha256 else cad, True)

    def of_id(self, cad_id: str) -> CadModel:
        """The model of that id.

        Raises:
            LibraryError: there is none.
        """
        return self.opened().get(cad_id)

    def of_key(self, key: str) -> CadModel | None:
        """The model whose mesh has that digest."""
        return self._by_key.get(key)

    def mesh(self, cad: CadModel) -> Mesh | None:
        """Its mesh; None where the library lacks this very model, or its file is damaged."""
        if self.library is None or not self.has(cad):
            return None
        try:
            return self.library.mesh(cad.id)
        except LibraryError:
            return None

    def page(
        self, category: str | None, text: str, after: str | None, limit: int
    ) -> tuple[list[CadModel], str | None]:
        """Models by name after one of that id, and the id to go on after; None at the end."""
        words = text.casefold().split()
        first = 0 if after is None else self._place.get(after, len(self._in_order) - 1) + 1
        found: list[CadModel] = []
        for model, told in self._in_order[first:]:
            if (category is None or model.category == category) and all(word in told for word in words):
                if len(found) == limit:
                    return found, found[-1].id
                found.append(model)
        return found, None

    def twins(self, cad: CadModel) -> tuple[str, list[list[float]], bool]:
        """Name of the model's symmetry, rotations R_s_from_s beside the identity, whether any turn is one.

        Raises:
            LibraryError: there is no library, or the model's file is damaged.
        """
        group = self.opened().symmetry(cad)
        if group.every:
            # All rotations look alike: turns about the upright axis stand for them.
            turns = group.about().equivalents(np.eye(3), STEPS)
        else:
            turns = group.equivalents(np.eye(3), STEPS)
        beside = [R for R in turns if not np.allclose(R, np.eye(3), atol=1e-6)][:MOST_TWINS]
        continuous = group.every or group.axis is not None
        return group.name, [[float(v) for v in R.ravel()] for R in beside], continuous
