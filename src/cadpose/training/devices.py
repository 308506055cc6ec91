"""Where networks are trained."""

from __future__ import annotations

import contextlib
import ctypes

import torch

from cadpose.errors import DependencyError


def torch_device(name: str) -> torch.device:
    """The device of that name.

    Raises:
        DependencyError: it is not there.
    """
    if name == "cuda" and not torch.cuda.is_available():
        raise DependencyError("--device cuda needs a GPU and a build of torch for CUDA; neither is seen here")
    return torch.device(name)


def repeatable_device(name: str) -> torch.device:
    """As :func:`torch_device`; the same seed gives the same curves there, as far as cuDNN goes.

    Raises:
        DependencyError: it is not there.
    """
    device = torch_device(name)
    torch.backends.cudnn.deterministic = True
    torch.backends.cudnn.benchmark = False
    return device


#: Of glibc's malloc.h.
_TRIM_THRESHOLD, _TOP_PAD, _MMAP_THRESHOLD = -1, -2, -3


def keep_memory() -> None:
    """Have glibc keep the memory that tensors give back: fetching it anew takes half of a step's time.

    Other C libraries stay as they are.
    """
    with contextlib.suppress(OSError, AttributeError):
        mallopt = ctypes.CDLL(None).mallopt
        for parameter, size in (
            (_MMAP_THRESHOLD, 1 << 30),
            (_TRIM_THRESHOLD, (1 << 31) - 1),
            (_TOP_PAD, 1 << 28),
        ):
            mallopt(parameter, size)
