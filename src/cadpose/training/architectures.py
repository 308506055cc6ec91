"""The rotation networks that can be trained, by name.

Nothing here needs torch until a network is asked for. To add one, write a module with the two functions
of :class:`Architecture` and list it in :data:`ARCHITECTURES` and :data:`TAKES`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast

from cadpose.errors import CadposeError, DependencyError


@dataclass(frozen=True, slots=True, kw_only=True)
class TrainingOptions:
    """What every training is told.

    Which of the optional ones an architecture takes is told in :data:`TAKES`.

    Attributes:
        out: Folder for checkpoint, curves and the trained network.
        data: Label file, JSON or JSONL.
        library: Folder of the CAD library to draw photos of; None for the user's.
        backgrounds: Folder of photos to cut backdrops from; None for made-up ones.
        steps: Optimiser steps, None for the architecture's own number.
        photos: Photos to draw, None for the architecture's own number.
        validation: Label file to measure on after every epoch, or None.
        init: Weights to start from: ``"random"``, a name that the architecture knows, or a path;
            None for the architecture's own choice.
        epochs: None for the architecture's own number.
        batch_size: Photos or objects a step, None for the architecture's own number.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds initial weights, order and augmentation.
        resume: Go on from the checkpoint in ``out``.
        workers: Threads that read photos or processes that draw them, 0 for as many as there are cores.

    Raises:
        ValueError: a number is out of range.
    """

    out: Path
    data: Path | None = None
    library: Path | None = None
    backgrounds: Path | None = None
    steps: int | None = None
    photos: int | None = None
    validation: Path | None = None
    init: str | None = None
    epochs: int | None = None
    batch_size: int | None = None
    device: str = "cpu"
    seed: int = 0
    resume: bool = False
    workers: int = 0

    def __post_init__(self) -> None:
        counts = (self.epochs, self.steps, self.photos)
        if any(n is not None and n < 1 for n in counts) or self.seed < 0 or self.workers < 0:
            raise ValueError("epochs, steps and photos must be at least 1, seed and workers at least 0")
        if self.batch_size is not None and self.batch_size < 2:
            raise ValueError("a batch must hold at least 2 photos, for BatchNorm")


@dataclass(frozen=True, slots=True)
class TrainingReport:
    """What a training made.

    Attributes:
        network: The exported ONNX file; of a member of the embedded network, its weights.
        checkpoint: Weights and optimiser at the end.
        curves: JSONL with these rows and perhaps others.
        epochs: One row an epoch, or a look at unseen models: losses, learning rate, accuracies.
        validation: What was measured last, by class and overall; None where nothing was.
        difference: Largest difference between the exported network and torch's; None without an export.
    """

    network: Path
    checkpoint: Path
    curves: Path
    epochs: list[dict[str, float]]
    validation: dict[str, Any] | None
    difference: float | None


#: Called after every step with the steps done and the steps in all.
OnStep = Callable[[int, int], None]


class Architecture(Protocol):
    """A module that trains and exports one network."""

    def train(self, options: TrainingOptions, on_step: OnStep) -> TrainingReport:
        """Train by the options."""
        ...

    def export(
        self, weights: str, path: Path, heads: Sequence[Path] = (), embedding: Path | None = None
    ) -> float | None:
        """Write the network of a checkpoint, a path or a known name, as ONNX; the largest difference.

        ``heads`` are further members where the network has some, ``embedding`` is a second file where it
        embeds views too. None where the exporter compares by itself.
        """
        ...


#: Name to module; the default comes first.
ARCHITECTURES: dict[str, str] = {
    "posecontrast": "cadpose.training.posecontrast.train",
    "lite0": "cadpose.training.lite.lite0",
    "lite0-head": "cadpose.training.lite.lite0_head",
}

_DRAWN = frozenset({"library", "backgrounds", "batch_size"})
#: Those of the options that are None unless told which an architecture takes.
TAKES: dict[str, frozenset[str]] = {
    "posecontrast": frozenset({"data", "validation", "init", "epochs", "batch_size"}),
    "lite0": _DRAWN | {"steps"},
    "lite0-head": _DRAWN | {"photos", "epochs"},
}


def architecture(name: str) -> Architecture:
    """The module of an architecture.

    Raises:
        CadposeError: none has that name.
        DependencyError: torch is not installed.
    """
    if name not in ARCHITECTURES:
        raise CadposeError(f"unknown architecture {name!r}, choose one of: {', '.join(ARCHITECTURES)}")
    return cast(Architecture, training_module(ARCHITECTURES[name]))


def training_module(name: str) -> ModuleType:
    """A module that trains, by its full name.

    Raises:
        DependencyError: torch or another package that it needs is not installed.
    """
    try:
        return import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] == "cadpose":
            raise
        raise DependencyError(
            f"training needs the package {error.name}: pip install 'cadpose[train]'"
        ) from error
