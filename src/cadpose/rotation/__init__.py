"""How an object is turned: rotation estimators behind one protocol."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from cadpose.records import CadModel, RotationHypothesis


class RotationEstimator(Protocol):
    """Answers how the object in a crop is turned.

    ``estimate`` gets the square crop of the photo, (224, 224, 3) uint8, in which the longer side of
    the object's box fills the square, and the CAD models of the object's category (an estimator may
    do without them). It returns hypotheses, best first, at least one.

    Examples:
        >>> import numpy as np
        >>> from cadpose import Rotation
        >>> from cadpose.records import RotationHypothesis
        >>> class Upright:
        ...     name = "upright"
        ...
        ...     def estimate(self, crop, cads):
        ...         return [RotationHypothesis(Rotation(a, 10), 0.0, 0.25) for a in (30, 120, 210, 300)]
        >>> [h.rotation.azimuth for h in Upright().estimate(np.zeros((224, 224, 3), np.uint8), ())]
        [30.0, 120.0, 210.0, 300.0]

        ``Annotator(rotation=Upright())`` uses it; the ranking follows the first three.
    """

    name: str

    def estimate(self, crop: NDArray[np.uint8], cads: Sequence[CadModel]) -> list[RotationHypothesis]:
        """Rotation hypotheses, best first."""
        ...
