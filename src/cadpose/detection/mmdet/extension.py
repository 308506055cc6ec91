"""A stand-in for ``mmcv._ext``, the compiled part of mmcv: its operators that DetectoRS needs, in PyTorch.

``mmcv.ops`` asks for some eighty names when it is imported; those that are not given raise when called.
"""

from __future__ import annotations

import importlib.util
import sys
import types
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NoReturn

from cadpose.detection.mmdet import operators

if TYPE_CHECKING:
    from torch import Tensor

NAME = "mmcv._ext"


def nms(bboxes: Tensor, scores: Tensor, *, iou_threshold: float, offset: int) -> Tensor:
    """Indices of the kept boxes; see :func:`operators.suppress`."""
    return operators.suppress(bboxes, scores, iou_threshold, offset)


def roi_align_forward(
    features: Tensor,
    rois: Tensor,
    output: Tensor,
    argmax_y: Tensor,
    argmax_x: Tensor,
    *,
    aligned_height: int,
    aligned_width: int,
    spatial_scale: float,
    sampling_ratio: int,
    pool_mode: int,
    aligned: bool,
) -> None:
    """Fill ``output``; see :func:`operators.roi_align`."""
    del argmax_y, argmax_x  # of pooling by maximum
    if pool_mode != 1:
        raise NotImplementedError("RoIAlign by maximum is not among the operators that cadpose gives")
    size = (aligned_height, aligned_width)
    output.copy_(
        operators.roi_align(features, rois, size, spatial_scale, sampling_ratio, aligned=bool(aligned))
    )


def deform_conv_forward(
    features: Tensor,
    weight: Tensor,
    offset: Tensor,
    output: Tensor,
    columns: Tensor,
    ones: Tensor,
    *,
    kW: int,
    kH: int,
    dW: int,
    dH: int,
    padW: int,
    padH: int,
    dilationW: int,
    dilationH: int,
    group: int,
    deformable_group: int,
    im2col_step: int,
) -> None:
    """Fill ``output``; see :func:`operators.deform_conv2d`."""
    del columns, ones, kW, kH, im2col_step  # room to work in, and what the weight's shape tells
    output.copy_(
        operators.deform_conv2d(
            features,
            offset,
            weight,
            stride=(dH, dW),
            padding=(padH, padW),
            dilation=(dilationH, dilationW),
            groups=group,
            offset_groups=deformable_group,
        )
    )


class _Extension(types.ModuleType):
    """Has every name that is asked for."""

    def __getattr__(self, name: str) -> Callable[..., NoReturn]:
        if name.startswith("__"):
            raise AttributeError(name)

        def absent(*args: object, **kwargs: object) -> NoReturn:
            raise NotImplementedError(f"{name} is not among the operators that cadpose gives to mmcv")

        return absent


def provide() -> bool:
    """Put the stand-in in place where mmcv has no compiled part of its own.

    Returns:
        Whether the stand-in is used.

    Raises:
        ImportError: mmcv is not there.
    """
    present: Any = sys.modules.get(NAME)
    if present is not None:
        return isinstance(present, _Extension)
    if importlib.util.find_spec(NAME) is not None:
        return False
    module = _Extension(NAME, "Given by cadpose in place of mmcv's compiled operators.")
    for given in (nms, roi_align_forward, deform_conv_forward):
        setattr(module, given.__name__, given)
    sys.modules[NAME] = module
    return True
