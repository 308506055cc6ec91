"""Where networks are trained."""

from __future__ import annotations

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
