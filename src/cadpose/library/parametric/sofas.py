"""Sofas: two to four places, with a chaise or around a corner, and the Chesterfield."""

from __future__ import annotations

from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric.seating import between, chance
from cadpose.library.parametric.upholstered import upholstered


def sofa(rng: Generator) -> Mesh:
    """A sofa; its back is at +z, those who sit on it look to -z."""
    places = int(rng.choice([2, 3, 4], p=[0.42, 0.48, 0.10]))
    chaise = between(rng, 0.45, 0.8) if chance(rng, 0.22) else 0.0
    return upholstered(rng, places, 4, chaise, 1 if chance(rng, 0.5) else -1).mesh("sofa")
