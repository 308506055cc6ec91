"""The numbers of the triplet baseline, each with its source."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from cadpose.similarity.triplet_framing import Framing

#: Blocks of convolutions that VGG16 has.
BLOCKS = 5


@dataclass(frozen=True, slots=True)
class Recipe:
    """Numbers of the method; the published ones are the defaults.

    Of the paper (section 4.4): ``negatives``, ``mined``, ``rate``, ``batch_size``. Of Langer's published
    code: ``framing``, ``trained_blocks``, ``normalise``. Defaults of pytorch-NetVlad, on which that code
    rests: ``margin``, ``momentum``, ``weight_decay``. Ours, for none of them tells it: ``epochs``.

    Attributes:
        negatives: Renders of other CAD models for each photo.
        mined: How many of them, the nearest to the photo, come back in the next epoch where negatives are
            mined.
        rate: SGD's learning rate, the same throughout.
        batch_size: Photos a step.
        framing: How crops and renders are shown.
        trained_blocks: How many of VGG16's five blocks, counted from the last, are trained; the others
            stay as they were.
        normalise: Subtract ImageNet's mean and divide by its deviation; else levels are only divided by
            255.
        margin: By how much a negative must be farther than the positive.
        momentum: SGD's momentum.
        weight_decay: SGD's weight decay.
        epochs: Passes over the photos.
        width: Channels of the first block; 64 is VGG16.

    Raises:
        ValueError: a number is out of range.
    """

    negatives: int = 10
    mined: int = 7
    rate: float = 2e-6
    batch_size: int = 6
    framing: Framing = field(default_factory=Framing)
    trained_blocks: int = 1
    normalise: bool = False
    margin: float = math.sqrt(0.1)
    momentum: float = 0.9
    weight_decay: float = 1e-3
    epochs: int = 30
    width: int = 64

    def __post_init__(self) -> None:
        if not self.negatives >= 1 or not 0 <= self.mined <= self.negatives:
            raise ValueError("there must be at least 1 negative and no more mined ones than negatives")
        if min(self.batch_size, self.epochs, self.width) < 1 or not 1 <= self.trained_blocks <= BLOCKS:
            raise ValueError(f"batch_size, epochs and width must be at least 1, trained_blocks 1 to {BLOCKS}")
        if not (self.rate > 0 and self.margin > 0 and self.momentum >= 0 and self.weight_decay >= 0):
            raise ValueError("rate and margin must be above 0, momentum and weight_decay not below")


#: The published recipe.
RECIPE = Recipe()
