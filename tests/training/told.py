"""What small trainings are told."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from cadpose.library.catalogue import Library
from cadpose.training.architectures import TrainingOptions

#: Numbers of a recipe for what is drawn.
TINY: dict[str, Any] = {"fresh": 1, "buffer": 24, "warmup": 1, "validate_every": 2}


def options(library: Library, out: Path, **told: Any) -> TrainingOptions:
    """Two objects a step of that library, drawn by one process, unless told."""
    return TrainingOptions(out=out, library=library.path, **{"workers": 1, "batch_size": 2, **told})
