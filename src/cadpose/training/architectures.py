"""The rotation networks that can be trained, by name.

Nothing here needs torch until a network is asked for. To add one, write a module with the two functions
of :class:`Architecture` and list it in :data:`ARCHITECTURES`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, cast

from cadpose.errors import CadposeError, DependencyError


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingOptions:
    """What every training is told.

    Attributes:
        data: Label file, JSON or JSONL.
        out: Folder for checkpoint, curves and the exported network.
        validation: Label file to measure on after every epoch, or None.
        init: Weights to start from: ``"random"``, a name that the architecture knows, or a path;
            None for the architecture's own choice.
        epochs: None for the architecture's own number.
        batch_size: Photos a step, None for the architecture's own number.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds initial weights, order and augmentation.
        resume: Go on from the checkpoint in ``out``.
        workers: Threads that read photos, 0 for as many as there are cores.

    Raises:
        ValueError: a number is out of range.
    """

    data: Path
    out: Path
    validation: Path | None = None
    init: str | None = None
    epochs: int | None = None
    batch_size: int | None = None
    device: str = "cpu"
    seed: int = 0
    resume: bool = False
    workers: int = 0

    def __post_init__(self) -> None:
        if (self.epochs is not None and self.epochs < 1) or self.seed < 0 or self.workers < 0:
            raise ValueError("epochs must be at least 1, seed and workers at least 0")
        if self.batch_size is not None and self.batch_size < 2:
            raise ValueError("a batch must hold at least 2 photos, for BatchNorm")


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """What a training made.

    Attributes:
        network: The exported ONNX file.
        checkpoint: Weights and optimiser after the last epoch.
        curves: JSONL with the same rows as ``epochs``.
        epochs: One row an epoch: losses, learning rate, accuracies.
        validation: Table of :func:`cadpose.evaluation.rotation.rotation_table` after the last epoch.
        difference: Largest difference between the exported network and torch's.
    """

    network: Path
    checkpoint: Path
    curves: Path
    epochs: list[dict[str, float]]
    validation: dict[str, Any] | None
    difference: float


#: Called after every step with the steps done and the steps in all.
OnStep = Callable[[int, int], None]


class Architecture(Protocol):
    """A module that trains and exports one network."""

    def train(self, options: TrainingOptions, on_step: OnStep) -> TrainingReport:
        """Train by the options."""
        ...

    def export(self, weights: str, path: Path) -> float:
        """Write the network of a checkpoint, a path or a known name, as ONNX; the largest difference."""
        ...


#: Name to module; the default comes first.
ARCHITECTURES: dict[str, str] = {"posecontrast": "cadpose.training.posecontrast.train"}


def architecture(name: str) -> Architecture:
    """The module of an architecture.

    Raises:
        CadposeError: none has that name.
        DependencyError: torch is not installed.
    """
    if name not in ARCHITECTURES:
        raise CadposeError(f"unknown architecture {name!r}, choose one of: {', '.join(ARCHITECTURES)}")
    try:
        return cast(Architecture, import_module(ARCHITECTURES[name]))
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "cadpose":
            raise
        raise DependencyError(
            f"training needs the package {error.name}: pip install 'cadpose[train]'"
        ) from error
