"""Files of ``torch.save``, read without unpickling objects."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from cadpose.errors import InputError

log = logging.getLogger(__name__)


def read_torch_file(path: Path, most: int, network: str = "this network") -> Any:
    """Tensors, numbers, texts and containers of them, nothing else; needs PyTorch.

    Args:
        path: The file.
        most: Largest number of bytes that is read.
        network: Whose checkpoint it should be, for the message.

    Raises:
        InputError: it is not there, too large, or holds anything else.
    """
    import torch

    try:
        size = path.stat().st_size
        if not path.is_file():
            raise InputError(f"{path}: is not a file, name a checkpoint")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}), check the path") from error
    if size > most:
        raise InputError(f"{path}: larger than {most >> 20} MiB, which no checkpoint of {network} is")
    try:
        return torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # the unpickler raises anything at all on hostile bytes
        log.debug("%s", path, exc_info=True)
        raise InputError(
            f"{path}: is no checkpoint of plain tensors ({type(error).__name__}), fetch or save it anew"
        ) from None
