"""How alike a photo's crop and renders of candidate CADs are: aligned Lite0 maps, or the paper's measures."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask, Views


class SimilarityMeasure(Protocol):
    """Scores renders of the candidates against one crop.

    Examples:
        >>> import numpy as np
        >>> from cadpose.records import Views
        >>> class MeanColour:
        ...     name = "mean-colour"
        ...
        ...     def score(self, crop, mask, views, *, aspect=None):
        ...         mine = crop.reshape(-1, 3).mean(axis=0)
        ...         theirs = views.over(255).reshape(len(views), -1, 3).mean(axis=1)
        ...         return -np.linalg.norm(theirs - mine, axis=1)
        >>> black, clear = np.zeros((2, 8, 8, 3), np.uint8), np.zeros((2, 8, 8), np.uint8)
        >>> clear[1] = 255  # the first is seen through, the second covers all
        >>> views = Views(black, clear, np.ones((2, 8, 8), np.float32))
        >>> MeanColour().score(np.zeros((8, 8, 3), np.uint8), None, views).round()
        array([-442.,   -0.])

        ``Annotator(similarity=MeanColour())`` uses it, in place of the joint ranking.
    """

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
