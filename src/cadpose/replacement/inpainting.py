"""Painting over what was removed, by a library: PatchMatch of the package PyPatchMatch, or OpenCV's.

Large holes are filled at reduced size in the part of the photo about them, and pasted back.
"""

from __future__ import annotations

import logging
from importlib.util import find_spec
from threading import Lock
from typing import Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.records import Mask

log = logging.getLogger(__name__)

#: Pixels of the hole, and of the part about it, that are filled at once.
MAX_HOLE, MAX_AREA = 10_000, 120_000
_PATCH_RADIUS = 3
# The library's seed belongs to the process.
_LOCK = Lock()


class Inpainter(Protocol):
    """Fills a hole with what could be there."""

    name: str

    def fill(self, rgb: NDArray[np.uint8], hole: Mask, barred: Mask) -> NDArray[np.uint8]:
        """The (H, W, 3) picture with the (H, W) hole filled.

        ``barred`` pixels, other objects for example, are not to be copied from.
        """
        ...


class PatchInpainter:
    """PatchMatch (Barnes et al. 2009) with Wexler et al.'s completion, from coarse to fine.

    Args:
        seed: Of its random search.
    """

    name = "patchmatch"

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed

    def fill(self, rgb: NDArray[np.uint8], hole: Mask, barred: Mask) -> NDArray[np.uint8]:
        """See `Inpainter`."""
        import patchmatch

        with _LOCK:
            patchmatch.set_random_seed(self.seed)
            filled = patchmatch.inpaint(
                np.ascontiguousarray(rgb),
                hole,
                global_mask=barred & ~hole if (barred & ~hole).any() else None,
                patch_size=_PATCH_RADIUS,
            )
        return np.asarray(filled, np.uint8)


class FastMarchingInpainter:
    """OpenCV's fast marching (Telea 2004): smears colours from the rim inwards; always there."""

    name = "telea"

    def fill(self, rgb: NDArray[np.uint8], hole: Mask, barred: Mask) -> NDArray[np.uint8]:
        """See `Inpainter`; what is barred is smeared in all the same."""
        mask = hole.astype(np.uint8) * 255
        return np.asarray(cv2.inpaint(np.ascontiguousarray(rgb), mask, 5.0, cv2.INPAINT_TELEA), np.uint8)


def default_inpainter(seed: int = 0) -> Inpainter:
    """PatchMatch where the extra ``replace`` is installed, else OpenCV's, with a warning."""
    if find_spec("patchmatch") is not None:
        import patchmatch

        if patchmatch.patchmatch_available:
            return PatchInpainter(seed)
    log.warning(
        "the background will be smeared, as PyPatchMatch is not there: pip install 'cadpose[replace]'"
    )
    return FastMarchingInpainter()


def paint_over(
    rgb: NDArray[np.uint8], region: Mask, barred: Mask, inpainter: Inpainter, floor: float = float("inf")
) -> NDArray[np.uint8]:
    """The photo without a region; nothing outside it changes.

    Args:
        rgb: (H, W, 3) uint8.
        region: (H, W) bool.
        barred: (H, W) bool, what is not to be copied from.
        inpainter: What fills it.
        floor: First row of the ground: what lies below it is filled first, and from below it.
    """
    first = int(np.clip(floor, 0, region.shape[0])) if np.isfinite(floor) else region.shape[0]
    below = np.zeros_like(region)
    below[first:] = True
    ground, rest = region & below, region & ~below
    # A strip of ground beside the object is enough; without one there is nothing to copy.
    if (below & ~region & ~barred).sum() >= 0.25 * ground.sum() and ground.any() and rest.any():
        half = _filled(rgb, ground, barred | ~below, rest, inpainter)
        return _filled(half, rest, barred | ground, np.zeros_like(rest), inpainter)
    return _filled(rgb, region, barred, np.zeros_like(region), inpainter)


def _filled(
    rgb: NDArray[np.uint8], region: Mask, barred: Mask, unknown: Mask, inpainter: Inpainter
) -> NDArray[np.uint8]:
    """As `paint_over`, in one go; ``unknown`` is neither filled nor copied."""
    barred = barred | unknown
    if not region.any():
        return rgb.copy()
    if region.all():
        # There is nothing to copy from: its own mean is no worse than anything else.
        return np.broadcast_to(rgb.reshape(-1, 3).mean(axis=0).astype(np.uint8), rgb.shape).copy()
    rows, columns = _part(region)
    part, hole, apart = rgb[rows, columns], region[rows, columns], barred[rows, columns]
    if not (~hole & ~apart).any():
        apart = np.zeros_like(apart)
    scale = min(1.0, (MAX_HOLE / hole.sum()) ** 0.5, (MAX_AREA / hole.size) ** 0.5)
    small, small_hole, small_apart = part, hole, apart
    if scale < 1.0:
        height, width = (max(8, round(n * scale)) for n in hole.shape)
        small_hole = _reduced(hole, width, height)
        small_apart = _reduced(apart, width, height)
        # What is removed must not bleed into the rim when the picture is reduced.
        weight = cv2.resize((~hole).astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
        known = cv2.resize(
            np.where(hole[..., None], 0, part).astype(np.float32),
            (width, height),
            interpolation=cv2.INTER_AREA,
        )
        small = np.round(known / np.maximum(weight, 1e-3)[..., None]).clip(0, 255).astype(np.uint8)
        if (small_hole | small_apart).all():
            # What is known is thinner than a reduced pixel: its mean is no worse than anything else.
            plain = part[~hole & ~apart].mean(axis=0)
            out = rgb.copy()
            out[rows, columns] = np.where(hole[..., None], np.round(plain).astype(np.uint8), part)
            return out
    filled = inpainter.fill(small, small_hole, small_apart)
    if scale < 1.0:
        size = (hole.shape[1], hole.shape[0])
        filled = np.asarray(cv2.resize(filled, size, interpolation=cv2.INTER_CUBIC), np.uint8)
    out = rgb.copy()
    out[rows, columns] = np.where(hole[..., None], filled, part)
    return out


def _part(region: Mask) -> tuple[slice, slice]:
    """Rows and columns of the hole with half its size about it."""
    told = []
    for axis, length in ((1, region.shape[0]), (0, region.shape[1])):
        at = np.flatnonzero(region.any(axis=axis))
        margin = max(24, (int(at[-1]) - int(at[0])) // 2)
        told.append(slice(max(0, int(at[0]) - margin), min(length, int(at[-1]) + 1 + margin)))
    return told[0], told[1]


def _reduced(mask: Mask, width: int, height: int) -> Mask:
    """Every pixel that touches the mask belongs to it."""
    share = cv2.resize(mask.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(share > 1e-3)
