"""What synthetic photos are like: every chance and range in one place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

Range = tuple[float, float]


@dataclass(frozen=True)
class SynthOptions:
    """Chances are in [0, 1], angles in degrees, lengths in shares of the photo's side.

    Attributes:
        size: Side of the square photo in pixels.
        series: Photos that share their shapes before new ones are drawn.
        shapes: Shapes of a series; each photo shows one of them, and perhaps others beside it.
        fill: Longer side of the main object's rectangle.
        distance: t_z of the camera in model diagonals, drawn evenly on a logarithmic scale.
        warp: Strength of non-uniform shape warps, 0 for none.
        redress: Chance that a shape's colours and textures are changed.
        company: Chance of each of two further objects.
        occluder: Chance that something covers part of the main object.
        truncate: Chance that the photo's border cuts the main object off.
        shadow: Chance of a shadow on the ground.
        backdrop_photo: Chance that the backdrop is a photo, where a folder of them is given.
        degrade: Chance of each of blur, noise, low resolution and JPEG.
        weights: How often a category is drawn; by default the square root of its number of models.
    """

    size: int = 224
    series: int = 12
    shapes: int = 4
    fill: Range = (0.45, 0.95)
    distance: Range = (1.3, 5.0)
    warp: float = 1.0
    redress: float = 0.65
    company: float = 0.25
    occluder: float = 0.2
    truncate: float = 0.1
    shadow: float = 0.6
    backdrop_photo: float = 0.6
    degrade: float = 0.3
    weights: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not 32 <= self.size <= 4096:
            raise ValueError(f"size must be 32 to 4096 pixels, got {self.size}")
        if self.series < 1 or self.shapes < 1:
            raise ValueError("series and shapes must be at least 1")
        for name in ("redress", "company", "occluder", "truncate", "shadow", "backdrop_photo", "degrade"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is a chance in [0, 1], got {getattr(self, name)}")
        for name, low, high in (("fill", 0.05, 1.5), ("distance", 0.8, 50.0)):
            a, b = getattr(self, name)
            if not low <= a <= b <= high:
                raise ValueError(f"{name} must be a range within [{low}, {high}], got {(a, b)}")
        if self.warp < 0:
            raise ValueError(f"warp must not be negative, got {self.warp}")
