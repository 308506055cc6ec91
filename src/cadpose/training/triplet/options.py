"""What a training of the triplet baseline is told, and what it makes."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

#: What may draw the CAD models.
RENDERERS = ("raster", "blender")


@dataclass(frozen=True, slots=True, kw_only=True)
class TripletOptions:
    """What a training is told.

    Attributes:
        data: Label file; photos with CAD model and rotation, and masks where the background is to go.
        out: Folder for checkpoint, curves and the trained network.
        library: Folder of the CAD library, None for the user's.
        validation: Label file to measure on after every epoch, or None.
        init: Weights to start from, see :func:`cadpose.training.triplet.loading.load_initial`. Not looked
            at where a training goes on.
        trained_blocks: How many of VGG16's five blocks learn, counted from the last; None for the recipe's
            number.
        mining: Use a photo's nearest negatives again.
        renderer: What draws the CAD models, one of :data:`RENDERERS`.
        epochs: None for the recipe's number.
        batch_size: None for the recipe's number.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seeds random weights, the order of photos, and negatives.
        resume: Go on from the checkpoint in ``out``.
        workers: Threads that read and draw, 0 for as many as there are cores.

    Raises:
        ValueError: a number is out of range, or no such renderer is known.
    """

    data: Path
    out: Path
    library: Path | None = None
    validation: Path | None = None
    init: str = "imagenet"
    trained_blocks: int | None = None
    mining: bool = False
    renderer: str = "raster"
    epochs: int | None = None
    batch_size: int | None = None
    device: str = "cpu"
    seed: int = 0
    resume: bool = False
    workers: int = 0

    def __post_init__(self) -> None:
        if any(n is not None and n < 1 for n in (self.epochs, self.batch_size)):
            raise ValueError("epochs and batch_size must be at least 1")
        if min(self.seed, self.workers) < 0:
            raise ValueError("seed and workers must be at least 0")
        if self.renderer not in RENDERERS:
            raise ValueError(f"renderer {self.renderer!r} is none of {', '.join(RENDERERS)}")


@dataclass(frozen=True, slots=True)
class TripletReport:
    """What a training made.

    Attributes:
        network: The exported ONNX file.
        checkpoint: Weights, optimiser and mined negatives at the end.
        curves: JSONL with the rows.
        initial: What the weights started from: ``"random"``, ``"imagenet"`` or a path.
        photos: Photos that were learned from.
        unmasked: Those among them that show their background, for want of a mask.
        epochs: One row an epoch.
        validation: What was measured last, by class and overall; None where nothing was.
        difference: Largest difference between the exported network and torch's.
    """

    network: Path
    checkpoint: Path
    curves: Path
    initial: str
    photos: int
    unmasked: int
    epochs: list[dict[str, float]]
    validation: dict[str, Any] | None
    difference: float
