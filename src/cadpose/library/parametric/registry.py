"""Which categories can be made, and the way to make one model."""

from __future__ import annotations

import zlib
from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from cadpose.errors import InputError
from cadpose.library.mesh import Mesh
from cadpose.library.parametric.appliances import fridge, toilet, tv
from cadpose.library.parametric.bag import bag
from cadpose.library.parametric.beds import bed
from cadpose.library.parametric.benches import bench
from cadpose.library.parametric.bicycle import bicycle
from cadpose.library.parametric.bookcases import bookcase
from cadpose.library.parametric.bottle import bottle
from cadpose.library.parametric.cabinets import cabinet
from cadpose.library.parametric.car import car
from cadpose.library.parametric.chairs import chair
from cadpose.library.parametric.clock import clock
from cadpose.library.parametric.electronics import keyboard, laptop, phone
from cadpose.library.parametric.heavy import bus, truck
from cadpose.library.parametric.kitchen import microwave, oven, washing_machine
from cadpose.library.parametric.lamps import lamp
from cadpose.library.parametric.motorbike import motorbike
from cadpose.library.parametric.sofas import sofa
from cadpose.library.parametric.tables import table
from cadpose.library.parametric.tableware import cup

GENERATORS: dict[str, Callable[[Generator], Mesh]] = {
    "bed": bed,
    "bench": bench,
    "chair": chair,
    "sofa": sofa,
    "bookcase": bookcase,
    "cabinet": cabinet,
    "table": table,
    "lamp": lamp,
    "tv": tv,
    "fridge": fridge,
    "toilet": toilet,
    "car": car,
    "bus": bus,
    "truck": truck,
    "motorbike": motorbike,
    "bicycle": bicycle,
    "clock": clock,
    "bag": bag,
    "bottle": bottle,
    "oven": oven,
    "microwave": microwave,
    "washing machine": washing_machine,
    "cup": cup,
    "laptop": laptop,
    "keyboard": keyboard,
    "phone": phone,
}
"""By library category: a function that draws one model from a random generator."""


def make(category: str, seed: int) -> Mesh:
    """One model of a category; the same seed gives the same mesh.

    Raises:
        InputError: there is no generator for the category.
    """
    if category not in GENERATORS:
        raise InputError(
            f"no parametric model of category {category!r}; there are {', '.join(sorted(GENERATORS))}."
        )
    # The category is part of the seed: equal seeds do not paint all categories alike.
    return GENERATORS[category](np.random.default_rng((zlib.crc32(category.encode()), seed)))
