"""How the triplet baseline is shown crops and renders: the object alone on black, small in a larger square.

Verified in Langer's published code (leveraging_geometry_for_shape_estimation, retrieval): crops of 150 px
stand in the middle of 256, black beside, the background masked black; renders are drawn on black.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.records import Mask, Views
from cadpose.similarity.local_features import resize_squares

_MOST_SIDE = 1024
#: Four halvings leave one cell.
_LEAST_SIDE = 16


@dataclass(frozen=True, slots=True)
class Framing:
    """The square that both encoders see.

    Attributes:
        side: Its side in pixels.
        longer: The longer side of the object's box in it, in the middle.
        masked: The photo's background is made black where there is a mask; else only what lies beside the
            box.

    Raises:
        ValueError: the sides do not fit.
    """

    side: int = 256
    longer: int = 150
    masked: bool = True

    def __post_init__(self) -> None:
        if not _LEAST_SIDE <= self.side <= _MOST_SIDE or not 1 <= self.longer <= self.side:
            raise ValueError(f"{self.longer} px in a square of {self.side} px do not fit")

    def photo(
        self, crop: NDArray[np.uint8], mask: Mask | None = None, aspect: float | None = None
    ) -> NDArray[np.uint8]:
        """A letterboxed crop as the photos' encoder sees it.

        Args:
            crop: (S, S, 3) uint8; the longer side of the object's box fills the square.
            mask: (S, S) bool mask of the object, or None. An empty one counts as none.
            aspect: Width / height of the box; what lies beside it is made black where no mask does that.

        Returns:
            (side, side, 3) uint8.

        Raises:
            ValueError: the crop is not (S, S, 3) uint8, or the mask not (S, S) bool.
        """
        if crop.dtype != np.uint8 or crop.ndim != 3 or crop.shape != (len(crop), len(crop), 3):
            raise ValueError(f"a crop must be (S, S, 3) uint8, got {crop.shape} {crop.dtype}")
        if mask is not None and (mask.shape != crop.shape[:2] or mask.dtype != np.bool_):
            raise ValueError(f"the mask must be {crop.shape[:2]} bool, got {mask.shape} {mask.dtype}")
        kept: Mask | None = None
        if self.masked and mask is not None and mask.any():
            kept = mask
        elif aspect is not None:
            kept = _within_box(len(crop), aspect)
        seen = crop if kept is None else np.where(kept[..., None], crop, np.uint8(0))
        return np.asarray(self._placed(np.asarray(seen)[None])[0])

    def renders(self, views: Views) -> NDArray[np.uint8]:
        """(N, side, side, 3) uint8 of N square renders framed without a margin.

        Raises:
            ValueError: the renders are not square.
        """
        if views.alpha.shape[1] != views.alpha.shape[2]:
            raise ValueError(f"renders must be square, got {views.alpha.shape[2]} x {views.alpha.shape[1]}")
        return self._placed(views.over(0))

    def to_json(self) -> str:
        """What the exported file tells of it."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> Framing:
        """What :meth:`to_json` wrote.

        Raises:
            ValueError: it is something else.
        """
        told: Any = json.loads(text)
        kinds = {"side": int, "longer": int, "masked": bool}
        if not isinstance(told, dict) or {k: type(v) for k, v in told.items()} != kinds:
            raise ValueError("no framing")
        return cls(**told)

    def _placed(self, squares: NDArray[np.uint8]) -> NDArray[np.uint8]:
        out = np.zeros((len(squares), self.side, self.side, 3), np.uint8)
        a = (self.side - self.longer) // 2
        out[:, a : a + self.longer, a : a + self.longer] = resize_squares(squares, self.longer)
        return out


def _within_box(size: int, aspect: float) -> Mask:
    """(size, size) bool: pixels wholly within a letterboxed box of that width / height, at least a line."""
    if not (np.isfinite(aspect) and aspect > 0):
        raise ValueError(f"aspect {aspect} must be positive")
    shorter = size * min(aspect, 1.0 / aspect)
    edge = min(int(np.ceil((size - shorter) / 2.0 - 1e-6)), (size - 1) // 2)
    line = np.zeros(size, np.bool_)
    line[edge : size - edge] = True
    square = np.repeat(line[:, None], size, axis=1)
    return square if aspect >= 1.0 else square.T
