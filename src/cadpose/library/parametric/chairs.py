"""Chairs of every kind: which kinds there are and how often each is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from cadpose.library.mesh import Mesh
from cadpose.library.parametric import chairs_frame, chairs_shell, chairs_soft
from cadpose.library.parametric.solids import Builder

KINDS: dict[str, tuple[float, Callable[[Generator], Builder]]] = {
    "dining": (5.0, chairs_frame.dining),
    "windsor": (1.5, chairs_frame.windsor),
    "rocking": (0.6, lambda rng: chairs_frame.dining(rng, rocking=True)),
    "folding": (0.7, chairs_frame.folding),
    "bar stool": (1.2, chairs_frame.bar_stool),
    "shell": (2.0, chairs_shell.shell),
    "office": (2.2, chairs_shell.office),
    "cantilever": (0.9, chairs_shell.cantilever),
    "garden": (0.8, chairs_shell.garden),
    "parsons": (1.6, chairs_soft.parsons),
    "club": (1.8, chairs_soft.club),
    "wing": (1.0, chairs_soft.wing),
    "tub": (1.2, chairs_soft.tub),
}
"""By name: how often, and the generator."""


def chair(rng: Generator) -> Mesh:
    """A chair or a stool; the back is at +z, the seat looks to -z."""
    names = list(KINDS)
    weights = np.array([KINDS[name][0] for name in names])
    name = names[int(rng.choice(len(names), p=weights / weights.sum()))]
    return KINDS[name][1](rng).mesh("chair")
