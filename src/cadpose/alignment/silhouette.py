"""The focal length whose silhouette fits a mask, for every f from one render.

With t_z fixed the silhouette scales exactly about the principal point O (Eq. 9: p - O is proportional to f).
So one rendered mask, enlarged by f / f_render about O, is the silhouette at f. The overlap with the photo's
mask only needs pixels inside that mask's box, which is brought to :data:`WORKING_SIDE` pixels;
the enlarged silhouette's area is known without drawing it. One scale costs one small image warp, cheaper
than a log-polar correlation over all of them and free of its resampling near O.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.alignment.focal import FocalFit
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.records import Mask

#: The box of the photo's mask is compared at this many pixels along its longer side.
WORKING_SIDE = 256
#: f is searched between equal-area size divided and multiplied by this.
SEARCH_RANGE = 3.0
_COARSE_STEPS = 41
_REFINEMENTS = 3


def focal_from_mask(
    render_coverage: Mask | NDArray[np.uint8],
    render_camera: Cameras,
    photo_mask: Mask,
    principal_px: tuple[float, float] | None = None,
    *,
    centred: bool = False,
) -> FocalFit:
    """The focal length that maximises the IoU of the scaled silhouette and the photo's mask.

    What reaches over the photo's edge counts as wrong: the mask is taken to show the whole object.

    Args:
        render_coverage: (H, W) bool mask or uint8 coverage (``Views.alpha``) of one render, not cut
            off by its image's edge.
        render_camera: The one camera it was rendered with; any principal point and focal length.
        photo_mask: (H, W) bool mask of the photo's size.
        principal_px: Principal point in the photo; the middle of the mask's box if None.
        centred: Instead, let the silhouettes' boxes share their middle and put the principal point where
            that leaves it, as :func:`cadpose.alignment.focal.align` does with the same name.

    Returns:
        The fit; its ``box_iou`` compares the rectangles of the two silhouettes.

    Raises:
        ValueError: a mask is empty, ``render_camera`` is not one camera of the render's size, or both
            ``principal_px`` and ``centred`` are given.
    """
    if centred and principal_px is not None:
        raise ValueError("give either principal_px or centred, not both")
    if len(render_camera) != 1 or render_coverage.shape != (render_camera.height, render_camera.width):
        raise ValueError("render_camera must be the one camera that the render was made with")
    render = _drawable(render_coverage)
    render_box = Box.from_mask(render >= 0.5)
    photo_box = Box.from_mask(photo_mask)
    # The point of the photo and that of the render about which all scales agree.
    fixed = photo_box.centre if principal_px is None else principal_px
    render_principal = render_camera.principal_px[0]
    render_fixed = np.array(render_box.centre) if centred else render_principal
    photo = _Window.around(photo_mask, photo_box)
    photo_area, render_area = float(photo_mask.sum()), float(render.sum(dtype=np.float64))

    def iou(scale: float) -> float:
        """IoU with ``scale`` pixels of the photo to one of the render."""
        inside = photo.overlap(render, render_fixed, fixed, scale)
        return inside / (photo_area + scale * scale * render_area - inside)

    grid = np.sqrt(photo_area / render_area) * np.geomspace(1.0 / SEARCH_RANGE, SEARCH_RANGE, _COARSE_STEPS)
    best_scale, best_iou = 0.0, -1.0
    for _ in range(_REFINEMENTS + 1):
        values = [iou(float(s)) for s in grid]
        best = int(np.argmax(values))
        if values[best] > best_iou:
            best_scale, best_iou = float(grid[best]), values[best]
        grid = np.linspace(grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)], 9)

    def to_photo(points: FloatArray) -> FloatArray:
        return np.asarray((points - render_fixed) * best_scale + fixed)

    rectangle = to_photo(np.array(render_box.to_tuple()).reshape(2, 2)).reshape(4)
    principal = to_photo(render_principal)
    return FocalFit(
        float(render_camera.focal_px[0]) * best_scale,
        float(box_iou(rectangle, np.array(photo_box.to_tuple()))),
        (float(principal[0]), float(principal[1])),
        min(max(best_iou, 0.0), 1.0),
    )


def _drawable(coverage: Mask | NDArray[np.uint8]) -> NDArray[np.float32]:
    full = 1.0 if coverage.dtype == np.bool_ else 255.0
    return np.asarray(coverage, np.float32) / np.float32(full)


@dataclass(frozen=True, eq=False)
class _Window:
    """The photo's mask within its box, resized: (h, w) coverage, working pixels a photo pixel in x and y."""

    mask: NDArray[np.float32]
    origin: tuple[float, float]
    per_px: tuple[float, float]

    @classmethod
    def around(cls, mask: Mask, box: Box) -> _Window:
        crop = mask[int(box.y0) : int(box.y1), int(box.x0) : int(box.x1)].astype(np.uint8) * np.uint8(255)
        factor = WORKING_SIDE / max(crop.shape)
        h, w = (max(round(side * factor), 1) for side in crop.shape)
        # A small mask keeps its pixels' shape, but is compared with the render more finely.
        resampler = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_NEAREST
        resized = cv2.resize(crop, (w, h), interpolation=resampler)
        return cls(
            resized.astype(np.float32) / np.float32(255.0),
            (box.x0, box.y0),
            (w / crop.shape[1], h / crop.shape[0]),
        )

    def overlap(
        self,
        render: NDArray[np.float32],
        render_fixed: FloatArray,
        fixed: tuple[float, float],
        scale: float,
    ) -> float:
        """Photo pixels² where both the mask and the render, enlarged about the fixed point, are set."""
        matrix = np.zeros((2, 3))
        for axis in range(2):
            step = 1.0 / (self.per_px[axis] * scale)
            # cv2 counts pixel centres as whole numbers, ours lie at halves.
            middle = (self.origin[axis] - fixed[axis]) / scale + render_fixed[axis]
            matrix[axis, axis], matrix[axis, 2] = step, middle + 0.5 * step - 0.5
        h, w = self.mask.shape
        drawn = cv2.warpAffine(render, matrix, (w, h), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)
        # An enlarged edge is a ramp several pixels wide: steepen it to the coverage of one pixel.
        drawn = np.clip((drawn - 0.5) * max(self.per_px[0] * scale, 1.0) + 0.5, 0.0, 1.0)
        both = np.minimum(drawn, self.mask).sum(dtype=np.float64)
        return float(both) / (self.per_px[0] * self.per_px[1])
