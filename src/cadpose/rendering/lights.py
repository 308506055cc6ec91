"""The light that the rasteriser draws with: fixed to the camera, so that all views are lit alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cadpose.geometry.frames import FloatArray

Direction = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Lights:
    """A key light, a fill light and an ambient term, in the camera frame (x right, y down, z forward).

    Attributes:
        key: Direction towards the key light; its length counts.
        key_strength: Intensity on a surface that faces it, in linear light; 1 shows the material's colour.
        fill: Direction towards the fill light.
        fill_strength: Likewise.
        ambient: Intensity everywhere.
        sky: What is added where the normal points up, and taken away where it points down.

    Raises:
        ValueError: a value is not finite or a strength negative, or the darkest ambient is below zero.
    """

    key: Direction = (-0.48, -0.62, -0.62)
    key_strength: float = 0.72
    fill: Direction = (0.80, -0.15, -0.58)
    fill_strength: float = 0.22
    ambient: float = 0.26
    sky: float = 0.10

    def __post_init__(self) -> None:
        if not np.isfinite(self.packed()).all():
            raise ValueError("lights must be finite")
        if min(self.key_strength, self.fill_strength, self.sky) < 0 or self.ambient < self.sky:
            raise ValueError("strengths must not be negative, and ambient not below sky")

    def packed(self) -> FloatArray:
        """(10,) key and its strength, fill and its strength, ambient, sky."""
        return np.array(
            [*self.key, self.key_strength, *self.fill, self.fill_strength, self.ambient, self.sky], np.float64
        )


STUDIO = Lights()
