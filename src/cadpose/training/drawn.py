"""Training on examples that worker processes draw without end: the streams, the loop, its checkpoint.

The mask network and the refinement network are trained so. What differs between them is a :class:`Lesson`.
"""

from __future__ import annotations

import io
import math
import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

import cv2
import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel
from torch.utils.data import DataLoader, IterableDataset

from cadpose.library.storage import write_atomic
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.checkpoints import read_checkpoint, set_optimiser, set_weights, tensors
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.folder import begin
from cadpose.training.lite.sources import Sources
from cadpose.training.lite.stream import Source, one_thread, worker_chunks
from cadpose.training.ring import Examples, Ring
from cadpose.training.synth.generator import SynthGenerator

CHECKPOINT = "checkpoint.pt"
#: Photos that a worker draws at once, a whole number of series.
_CHUNK = 2
#: Largest norm of a step's gradient.
_CLIP = 5.0

T = TypeVar("T", bound=Examples)


@dataclass(frozen=True)
class Recipe:
    """How to train.

    Attributes:
        steps: Optimiser steps.
        batch: Examples a step.
        fresh: New examples a step that enter the buffer.
        buffer: Examples kept.
        rate: Learning rate at its peak.
        decay: Weight decay.
        warmup: Steps until the peak.
        ema: Decay of the weights' moving average, which is what is shipped.
        seed: Of weights, batches and examples.
        validate_every: Steps between looks at unseen models.
    """

    steps: int
    batch: int
    fresh: int
    buffer: int
    rate: float
    decay: float
    warmup: int
    ema: float
    seed: int = 0
    validate_every: int = 1000


class DrawnStream(IterableDataset[T], Generic[T]):
    """Chunks of examples from photo ``first`` on; worker w of W draws chunks w, w + W, ...

    Args:
        source: What is drawn from.
        examples: Makes the examples of some photos, None where they show none.
        first: Number of the first photo.
        photos: How many photos, None for no end.
    """

    def __init__(
        self,
        source: Source,
        examples: Callable[[SynthGenerator, Sequence[int]], T | None],
        first: int = 0,
        photos: int | None = None,
    ) -> None:
        self.source, self.examples, self.first, self.photos = source, examples, first, photos

    @property
    def chunk(self) -> int:
        """Photos a chunk."""
        return _CHUNK * self.source.options.series

    def __iter__(self) -> Iterator[T]:
        generator = self.source.generator()
        for numbers in worker_chunks(self.first, self.photos, self.chunk):
            found = self.examples(generator, numbers)
            if found is not None:
                yield found


class Lesson(Protocol[T]):
    """What is trained on what.

    Attributes:
        name: Of the training, as its settings tell it.
        part: Key of the trained weights in the checkpoint.
        network: The whole network, on the device that trains.
        trained: The part of it that is trained.
    """

    name: str
    part: str
    network: nn.Module
    trained: nn.Module

    def examples(self, generator: SynthGenerator, numbers: Sequence[int]) -> T | None:
        """The examples that photos of these numbers give."""
        ...

    def lost(self, drawn: T, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        """What is to be made less, and what the curves tell."""
        ...

    def measured(self, average: nn.Module) -> dict[str, float]:
        """What averaged weights do on unseen models; empty where there is none."""
        ...

    def export(self, checkpoint: Path, network: Path) -> None:
        """Write the averaged weights of a checkpoint as ONNX."""
        ...


def train_drawn(
    lesson: Lesson[T],
    recipe: Recipe,
    drawn: Sources,
    options: TrainingOptions,
    on_step: OnStep,
    where: torch.device,
) -> TrainingReport:
    """Train; checkpoint and curves are written as it goes, the network at the end.

    Args:
        lesson: What is trained on what; the checkpoint goes by its names.
        recipe: How.
        drawn: What photos are drawn of.
        options: Folder, workers, and whether to go on.
        on_step: Called after every step.
        where: The device.

    Raises:
        InputError: the folder holds another training.
    """
    plain = {k: v for k, v in asdict(recipe).items() if k != "validate_every"}
    begin(options.out, {"architecture": lesson.name, **drawn.to_json(), "recipe": plain}, options.resume)
    average = moving_average(lesson.trained, recipe.ema)
    optimiser = torch.optim.AdamW(lesson.trained.parameters(), recipe.rate, weight_decay=recipe.decay)
    generator = torch.Generator(where).manual_seed(recipe.seed)
    kept, step, photos = _Kept(lesson, average, optimiser), 0, 0
    checkpoint = options.out / CHECKPOINT
    if options.resume and checkpoint.is_file():
        step, photos = kept.read(checkpoint)
        generator.manual_seed(recipe.seed + step)
    curves, begun = Curves(options.out, step), step
    stream = DrawnStream(drawn.train, lesson.examples, first=photos)
    incoming = _loader(stream, options.workers or os.cpu_count() or 1)
    ring: Ring[T] = Ring(recipe.buffer, where)
    start, entered = time.monotonic(), 0
    lesson.network.train()
    while step < recipe.steps:
        while ring.entered < max(recipe.batch * 4, (step - begun + 1) * recipe.fresh):
            ring.add(next(incoming))
            entered += stream.chunk
        share = 0.5 * (1.0 + math.cos(math.pi * step / recipe.steps))
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * min(1.0, (step + 1) / recipe.warmup) * share
        lost, told = lesson.lost(ring.draw(recipe.batch, generator), generator)
        optimiser.zero_grad(set_to_none=True)
        torch.autograd.backward([lost])
        torch.nn.utils.clip_grad_norm_(lesson.trained.parameters(), _CLIP)
        optimiser.step()
        average.update_parameters(lesson.trained)
        step += 1
        if step % 50 == 0:
            row = {"step": step, "entered": ring.entered, "seconds": round(time.monotonic() - start, 1)}
            curves.add(row | {name: float(value) for name, value in told.items()})
        if step % recipe.validate_every == 0 or step == recipe.steps:
            kept.write(checkpoint, step, photos + entered)
            average.module.eval()
            if measured := lesson.measured(average.module):
                curves.add({"step": step, "unseen": True, **measured})
        on_step(step, recipe.steps)
    curves.draw()
    rows = [row for row in curves.rows if row.get("unseen")]
    network = options.out / f"{lesson.name}.onnx"
    lesson.export(checkpoint, network)
    return TrainingReport(network, checkpoint, curves.path, rows, rows[-1] if rows else None, None)


def recipe_numbers(options: TrainingOptions, numbers: Mapping[str, Any]) -> dict[str, Any]:
    """The numbers of a recipe that were told, by its attributes' names."""
    told = {"steps": options.steps, "batch": options.batch_size, **numbers}
    return {"seed": options.seed, **{name: value for name, value in told.items() if value is not None}}


@dataclass(frozen=True, eq=False)
class _Kept:
    """What a checkpoint holds."""

    lesson: Lesson[Any]
    average: AveragedModel
    optimiser: torch.optim.Optimizer

    def write(self, path: Path, step: int, photos: int) -> None:
        data = io.BytesIO()
        torch.save(
            {
                "step": step,
                "photos": photos,
                self.lesson.part: self.lesson.trained.state_dict(),
                "average": self.average.module.state_dict(),
                "averaged": int(self.average.n_averaged),
                "optimiser": self.optimiser.state_dict(),
            },
            data,
        )
        write_atomic(path, data.getvalue())

    def read(self, path: Path) -> tuple[int, int]:
        content = read_checkpoint(path)
        set_weights(self.lesson.trained, tensors(content.get(self.lesson.part), str(path)), str(path))
        set_weights(self.average.module, tensors(content.get("average"), str(path)), str(path))
        self.average.n_averaged.fill_(int(content.get("averaged", 0)))
        set_optimiser(self.optimiser, content, path)
        return int(content["step"]), int(content["photos"])


def _loader(stream: DrawnStream[T], workers: int) -> Iterator[T]:
    # A forked process would wait for ever for OpenCV's threads, which stay behind.
    cv2.setNumThreads(1)
    return iter(
        DataLoader(stream, batch_size=None, num_workers=workers, prefetch_factor=2, worker_init_fn=one_thread)
    )
