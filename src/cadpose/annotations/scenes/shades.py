"""Light and colour of a scene: the rasteriser's lamps, and its display colours as linear light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cadpose.geometry.frames import FloatArray, R_gl_from_cv
from cadpose.rendering.lights import STUDIO, Lights


@dataclass(frozen=True, slots=True)
class Lamp:
    """A light from one direction.

    Attributes:
        name: What to call it.
        towards: Direction to the lamp in the scene, unit length.
        strength: Intensity on a surface that faces it; 1 shows the material's own colour.
    """

    name: str
    towards: tuple[float, float, float]
    strength: float

    def turn(self) -> FloatArray:
        """(3, 3) rotation that makes something that shines along -z shine away from the lamp."""
        z = np.array(self.towards)
        x = np.cross((0.0, 1.0, 0.0) if abs(z[1]) < 0.9 else (1.0, 0.0, 0.0), z)
        x /= np.linalg.norm(x)
        return np.stack([x, np.cross(z, x), z], axis=1)


def lamps(lights: Lights = STUDIO) -> list[Lamp]:
    """The rasteriser's key and fill, and a lamp at the camera in place of the light from all around."""
    directions = {"key light": lights.key, "fill light": lights.fill, "camera light": (0.0, 0.0, -1.0)}
    strengths = (lights.key_strength, lights.fill_strength, lights.ambient)
    made = []
    for (name, direction), strength in zip(directions.items(), strengths, strict=True):
        x, y, z = R_gl_from_cv @ np.array(direction) / np.linalg.norm(direction)
        made.append(Lamp(name, (float(x), float(y), float(z)), strength))
    return made


def linear_from_srgb(colour: Sequence[float]) -> tuple[float, float, float]:
    """Display colour in [0, 1] to linear light (IEC 61966-2-1)."""
    c = np.asarray(colour, np.float64)
    r, g, b = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(r), float(g), float(b)
