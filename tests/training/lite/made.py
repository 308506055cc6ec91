"""Sources over the small library, and made-up maps."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from cadpose.library.catalogue import Library
from cadpose.rotation.features import LEVELS
from cadpose.training.lite.maps import Maps
from cadpose.training.lite.stream import Source
from cadpose.training.synth.options import SynthOptions

CATEGORIES = ("car", "chair")


def source_of(library: Library, seed: int = 3, **options: Any) -> Source:
    told = SynthOptions(**{"size": 64, "series": 3, "shapes": 2, **options})
    return Source(library.path, tuple(m.id for m in library.models()), None, CATEGORIES, told, seed)


def made_maps(objects: int, seed: int = 0) -> Maps:
    """Two crops of each object, alike but for noise; azimuths spread around."""
    rng = np.random.default_rng(seed)
    cells = tuple(
        rng.integers(-40, 40, (objects, level.cells, level.channels)).astype(np.int8) for level in LEVELS
    )
    angles = np.stack(
        [rng.uniform(0, 360, objects), rng.uniform(-10, 40, objects), rng.uniform(-20, 20, objects)], axis=1
    ).astype(np.float32)
    once = Maps(cells, angles, np.ones(objects, np.int64), rng.integers(0, 2, objects))
    noisy = replace(once, cells=tuple(c + rng.integers(-2, 3, c.shape).astype(np.int8) for c in cells))
    return Maps.joined([once, noisy])
