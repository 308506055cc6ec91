"""How alike a photo's crop and renders of candidate CADs are: aligned Lite0 maps, or the paper's measures."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views


class SimilarityMeasure(Protocol):
    """Scores renders of the candidates against one crop."""

    name: str

    def score(
        self, crop: NDArray[np.uint8], mask: Mask | None, views: Views, *, aspect: float | None = None
    ) -> FloatArray:
        """Higher is better; comparable within one call only.

        Args:
            crop: (S, S, 3) uint8, the photo's tight box letterboxed: its longer side fills the square.
            mask: (S, S) bool mask of the object in the crop, or None.
            views: N candidates framed alike (``Cameras.framing`` with ``margin=0``), any square size.
            aspect: Width / height of the photo's box, if known.

        Returns:
            (N,) float64 scores.

        Raises:
            ValueError: crop or renders are not square or of another type.
        """
        ...
