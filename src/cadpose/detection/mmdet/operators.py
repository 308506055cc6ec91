"""The compiled operators that DetectoRS needs, in plain PyTorch: suppression, RoIAlign, deformed convolution.

They run wherever PyTorch does. Their rules at borders are those of mmcv's C++.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

#: Boxes that are compared with all later ones at a time.
_BLOCK = 256


def suppress(boxes: Tensor, scores: Tensor, threshold: float, offset: int = 0) -> Tensor:
    """Greedy non-maximum suppression.

    Args:
        boxes: (N, 4) x0, y0, x1, y1.
        scores: (N,).
        threshold: A box with a larger IoU with a kept one is dropped.
        offset: Width and height are x1 - x0 + offset and so on; 1 counts whole pixels.

    Returns:
        (K,) int64 indices of the kept boxes, best first; of equal scores the earlier box counts as better.
    """
    import torch

    order = scores.sort(descending=True, stable=True).indices
    boxes = boxes[order]
    area = (boxes[:, 2] - boxes[:, 0] + offset) * (boxes[:, 3] - boxes[:, 1] + offset)
    alive = torch.ones(len(boxes), dtype=torch.bool, device=boxes.device)

    def overlaps(left: Tensor, right: Tensor) -> Tensor:
        """(L, R) bool: whether the IoU is too large, for two index tensors."""
        a, b = boxes[left][:, None], boxes[right][None]
        low, high = torch.maximum(a[..., :2], b[..., :2]), torch.minimum(a[..., 2:], b[..., 2:])
        shared = (high - low + offset).clamp_(min=0).prod(dim=-1)
        return shared / (area[left][:, None] + area[right][None] - shared) > threshold

    for start in range(0, len(boxes), _BLOCK):
        block = start + torch.nonzero(alive[start : start + _BLOCK])[:, 0]
        if not len(block):
            continue
        # Within a block one box after the other; then all the kept ones against what is left.
        wins = overlaps(block, block).cpu().numpy()
        kept = np.ones(len(block), np.bool_)
        for i in range(len(block)):
            if kept[i]:
                kept[i + 1 :] &= ~wins[i, i + 1 :]
        keeps = torch.from_numpy(kept).to(boxes.device)
        alive[block[~keeps]] = False
        later = start + _BLOCK + torch.nonzero(alive[start + _BLOCK :])[:, 0]
        if len(later):
            alive[later[overlaps(block[keeps], later).any(dim=0)]] = False
    return order[alive]


def roi_align(
    features: Tensor,
    rois: Tensor,
    size: tuple[int, int],
    scale: float,
    sampling: int = 0,
    *,
    aligned: bool = True,
) -> Tensor:
    """Average pooling of bilinear samples in rectangles (He et al., Mask R-CNN, ICCV 2017, section 3).

    A sample's weight is the product of one for its row and one for its column, and so is a mean of samples:
    the result is ``rows @ features @ columns``, with two small matrices for each rectangle.

    Args:
        features: (B, C, H, W).
        rois: (K, 5) image index, x0, y0, x1, y1.
        size: Rows and columns of the result.
        scale: Cells a unit of ``rois``.
        sampling: Samples a side of each cell of the result; 0 takes as many as there are cells of features.
        aligned: Whether a cell's centre is at one half; False is the older rule without, and with no side
            below one cell.

    Returns:
        (K, C, *size).
    """
    half = 0.5 if aligned else 0.0
    low, high = rois[:, 1:3] * scale - half, rois[:, 3:5] * scale - half
    side = high - low
    if not aligned:
        side = side.clamp(min=1.0)
    columns, x0, x1 = _sample_weights(low[:, 0], side[:, 0], size[1], features.shape[3], sampling)
    rows, y0, y1 = _sample_weights(low[:, 1], side[:, 1], size[0], features.shape[2], sampling)
    # With the channels last both products are of long rows, which took a quarter of the time.
    last = features.permute(0, 2, 3, 1).contiguous()
    out = features.new_empty((len(rois), *size, features.shape[1]))
    image = rois[:, 0].long().tolist()
    for k in range(len(rois)):
        part = last[image[k], y0[k] : y1[k], x0[k] : x1[k]]
        strips = (rows[k, :, y0[k] : y1[k]] @ part.flatten(1)).reshape(size[0], *part.shape[1:])
        out[k] = columns[k, :, x0[k] : x1[k]] @ strips
    return out.permute(0, 3, 1, 2)


def _sample_weights(
    start: Tensor, side: Tensor, bins: int, cells: int, sampling: int
) -> tuple[Tensor, list[int], list[int]]:
    """Along one axis: (K, bins, cells) weights that average samples, and first and last cells of the K."""
    import torch

    step = side / bins
    count = step.new_full(step.shape, float(sampling)) if sampling > 0 else torch.ceil(step)
    most = max(int(count.max()), 1) if len(count) else 1
    which = torch.arange(most, device=start.device, dtype=start.dtype)
    first = start[:, None] + torch.arange(bins, device=start.device, dtype=start.dtype) * step[:, None]
    share = (which + 0.5) * (step / count.clamp(min=1))[:, None]
    at = first[:, :, None] + share[:, None]
    # Samples up to one cell outside take the border's value, those beyond count as zero.
    seen = (at >= -1.0) & (at <= cells) & (which < count[:, None, None])
    at = at.clamp(0.0, cells - 1.0)
    below = at.floor()
    above = at - below
    weight = seen / count.clamp(min=1)[:, None, None]
    low = below.long()
    high = (low + 1).clamp(max=cells - 1)
    out = start.new_zeros((len(start), bins, cells))
    out.scatter_add_(2, low, weight * (1.0 - above))
    out.scatter_add_(2, high, weight * above)
    if not len(start):
        return out, [], []
    first_cells, last_cells = torch.stack([low.amin(dim=(1, 2)), high.amax(dim=(1, 2)) + 1]).tolist()
    return out, first_cells, last_cells


def deform_conv2d(
    x: Tensor,
    offset: Tensor,
    weight: Tensor,
    stride: tuple[int, int] = (1, 1),
    padding: tuple[int, int] = (0, 0),
    dilation: tuple[int, int] = (1, 1),
    groups: int = 1,
    offset_groups: int = 1,
) -> Tensor:
    """Convolution whose taps are moved, place by place (Dai et al., ICCV 2017, eq. 2), without modulation.

    Args:
        x: (N, C, H, W); outside it counts as zero.
        offset: (N, offset_groups * taps * 2, H', W'), for each tap dy, then dx, in cells.
        weight: (O, C / groups, rows, columns).
        stride: Down and to the right, as are the following.
        padding: Cells of zeros around ``x``.
        dilation: Distance of the taps.
        groups: Blocks of channels that do not see each other.
        offset_groups: Blocks of channels with offsets of their own.

    Returns:
        (N, O, H', W').
    """
    import torch
    from torch.nn import functional as F

    n, channels, height, width = x.shape
    rows, columns = weight.shape[2:]
    taps = rows * columns
    out_height, out_width = offset.shape[2:]

    def counted(count: int) -> Tensor:
        return torch.arange(count, device=x.device, dtype=x.dtype)

    at_y = counted(out_height) * stride[0] - padding[0]
    at_x = counted(out_width) * stride[1] - padding[1]
    tap_y = (counted(rows) * dilation[0]).repeat_interleave(columns)
    tap_x = (counted(columns) * dilation[1]).repeat(rows)
    moved = offset.reshape(n * offset_groups, taps, 2, out_height, out_width)
    y = moved[:, :, 0] + tap_y[:, None, None] + at_y[:, None]
    x_at = moved[:, :, 1] + tap_x[:, None, None] + at_x
    # grid_sample counts from -1 to 1 between the outer edges of the outer cells.
    grid = torch.stack([(2 * x_at + 1) / width - 1, (2 * y + 1) / height - 1], dim=-1)
    sampled = F.grid_sample(
        x.reshape(n * offset_groups, channels // offset_groups, height, width),
        grid.reshape(n * offset_groups, taps * out_height, out_width, 2),
        mode="bilinear",
        padding_mode="zeros",
        align_corners=False,
    )
    patches = sampled.reshape(n, groups, channels // groups * taps, out_height * out_width)
    kernel = weight.reshape(groups, len(weight) // groups, -1)
    return (kernel @ patches).reshape(n, len(weight), out_height, out_width)
