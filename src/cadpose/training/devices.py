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
