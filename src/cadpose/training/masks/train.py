"""Train the box-to-mask network on synthetic photos, whose masks are exact."""

from __future__ import annotations

import io
import math
import os
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import cv2
import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel
from torch.utils.data import DataLoader

from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.checkpoints import read_checkpoint, set_optimiser, set_weights, tensors
from cadpose.training.devices import keep_memory, torch_device
from cadpose.training.lite.augment import NOTHING, Augmentation
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.folder import begin
from cadpose.training.lite.sources import Sources, sources
from cadpose.training.lite.stream import one_thread
from cadpose.training.masks.crops import Crops, crops
from cadpose.training.masks.export import export
from cadpose.training.masks.network import MaskNetwork
from cadpose.training.masks.stream import MaskedObjects, MaskStream
from cadpose.training.ring import Ring

CHECKPOINT, NETWORK = "checkpoint.pt", "masks.onnx"
#: Flaws of photos and of detectors' boxes.
FLAWS = Augmentation(jitter=0.1, colour=0.3, small=0.2, blur=0.2, noise=0.2, erase=0.0)
#: Boxes of unseen objects are off by this share of their sides, as a detector's.
UNSEEN_JITTER = 0.05
UNSEEN_PHOTOS = 192


@dataclass(frozen=True)
class Recipe:
    """How to train; unless told, as the shipped network was trained.

    Attributes:
        steps: Optimiser steps.
        batch: Objects a step.
        fresh: New objects a step that enter the buffer.
        buffer: Objects kept; one takes 0.33 MB.
        rate: Learning rate at its peak.
        decay: Weight decay.
        warmup: Steps until the peak.
        ema: Decay of the weights' moving average, which is what is shipped.
        seed: Of weights, batches and crops.
        validate_every: Steps between looks at unseen models.
        flaws: Of the crops.
    """

    steps: int = 3200
    batch: int = 32
    fresh: int = 10
    buffer: int = 6000
    rate: float = 2e-3
    decay: float = 0.01
    warmup: int = 100
    ema: float = 0.998
    seed: int = 0
    validate_every: int = 500
    flaws: Augmentation = FLAWS


def mask_sources(library: Library, backgrounds: Path | None, seed: int) -> Sources:
    """As for rotations, of all categories, with more company, more before the objects, and more cut off."""
    drawn = sources(library, backgrounds, seed, frontless=True)

    def crowded(source: Any) -> Any:
        options = replace(
            source.options, size=288, fill=(0.3, 0.95), company=0.5, occluder=0.3, truncate=0.2, degrade=0.25
        )
        return replace(source, options=options)

    return Sources(crowded(drawn.train), drawn.unseen and crowded(drawn.unseen))


def train(options: TrainingOptions, on_step: OnStep, **numbers: Any) -> TrainingReport:
    """Train by the options; checkpoint and curves are written as it goes, the network at the end.

    Args:
        options: ``library``, ``backgrounds``, ``steps`` and ``batch_size`` are used besides the common ones.
        on_step: Called after every step.
        **numbers: Other numbers of :class:`Recipe`.

    Raises:
        InputError: the library has nothing to learn from, or the folder holds another training.
        DependencyError: the device or Lite0's packages are not there.
    """
    where = torch_device(options.device)
    keep_memory()
    told: dict[str, Any] = {"steps": options.steps, "batch": options.batch_size, **numbers}
    recipe = Recipe(seed=options.seed, **{k: v for k, v in told.items() if v is not None})
    drawn = mask_sources(Library.open(options.library), options.backgrounds, options.seed)
    plain = {k: v for k, v in asdict(recipe).items() if k != "validate_every"}
    begin(options.out, {"architecture": "masks", **drawn.to_json(), "recipe": plain}, options.resume)
    torch.manual_seed(recipe.seed)
    # Depthwise convolutions of this layout take half the time on a CPU.
    model = MaskNetwork().to(where, memory_format=torch.channels_last)  # type: ignore[call-overload]
    average = moving_average(model.decoder, recipe.ema)
    optimiser = torch.optim.AdamW(model.decoder.parameters(), recipe.rate, weight_decay=recipe.decay)
    generator = torch.Generator(where).manual_seed(recipe.seed)
    checkpoint, step, photos = options.out / CHECKPOINT, 0, 0
    if options.resume and checkpoint.is_file():
        step, photos = _resumed(checkpoint, model, average, optimiser)
        generator.manual_seed(recipe.seed + step)
    curves, begun = Curves(options.out, step), step
    stream = MaskStream(drawn.train, first=photos)
    incoming = _loader(stream, options.workers or os.cpu_count() or 1)
    unseen = _unseen(drawn)
    buffer: Ring[MaskedObjects] = Ring(recipe.buffer, where)
    start, entered = time.monotonic(), 0
    model.train()
    while step < recipe.steps:
        while buffer.entered < max(recipe.batch * 4, (step - begun + 1) * recipe.fresh):
            buffer.add(next(incoming))
            entered += stream.chunk
        share = step / recipe.steps
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * min(1.0, (step + 1) / recipe.warmup) * _cosine(share)
        losses = _step(model, crops(buffer.draw(recipe.batch, generator), recipe.flaws, generator), optimiser)
        average.update_parameters(model.decoder)
        step += 1
        if step % 50 == 0:
            row = {"step": step, "entered": buffer.entered, "seconds": round(time.monotonic() - start, 1)}
            curves.add(row | {name: float(value) for name, value in losses.items()})
        if step % recipe.validate_every == 0 or step == recipe.steps:
            _save(checkpoint, model, average, optimiser, step, photos + entered)
            if unseen:
                curves.add({"step": step, "unseen": True, **_measured(model, average, unseen, where)})
        on_step(step, recipe.steps)
    curves.draw()
    rows = [row for row in curves.rows if row.get("unseen")]
    network = options.out / NETWORK
    export(checkpoint, network)
    return TrainingReport(network, checkpoint, curves.path, rows, rows[-1] if rows else None, None)


def _cosine(share: float) -> float:
    return 0.5 * (1.0 + math.cos(math.pi * share))


def mask_loss(logits: Tensor, masks: Tensor) -> Tensor:
    """Cross-entropy and soft Dice; logits and masks (N, H, W)."""
    p = logits.sigmoid()
    overlap = (p * masks).sum(dim=(1, 2))
    dice = 1.0 - (2.0 * overlap + 1.0) / (p.sum(dim=(1, 2)) + masks.sum(dim=(1, 2)) + 1.0)
    return functional.binary_cross_entropy_with_logits(logits, masks) + 0.5 * dice.mean()


def ious(logits: Tensor, masks: Tensor) -> Tensor:
    """(N,) IoU of the masks at even odds."""
    found, true = logits > 0.0, masks >= 0.5
    return (found & true).sum(dim=(1, 2)) / (found | true).sum(dim=(1, 2)).clamp(min=1)


def _step(model: MaskNetwork, seen: Crops, optimiser: torch.optim.Optimizer) -> dict[str, Tensor]:
    logits, quality = model(seen.images.contiguous(memory_format=torch.channels_last), seen.boxes)
    lost, true = mask_loss(logits, seen.masks), ious(logits.detach(), seen.masks)
    told = functional.binary_cross_entropy_with_logits(quality, true)
    optimiser.zero_grad(set_to_none=True)
    torch.autograd.backward([lost + 0.1 * told])
    torch.nn.utils.clip_grad_norm_(model.decoder.parameters(), 5.0)
    optimiser.step()
    return {"loss": lost.detach(), "quality": told.detach(), "iou": true.mean()}


def _loader(stream: MaskStream, workers: int) -> Iterator[MaskedObjects]:
    # A forked process would wait for ever for OpenCV's threads, which stay behind.
    cv2.setNumThreads(1)
    return iter(
        DataLoader(stream, batch_size=None, num_workers=workers, prefetch_factor=2, worker_init_fn=one_thread)
    )


def _unseen(drawn: Sources) -> list[Crops]:
    if drawn.unseen is None:
        return []
    flaws, generator = replace(NOTHING, jitter=UNSEEN_JITTER), torch.Generator().manual_seed(0)
    chunks = MaskStream(drawn.unseen, photos=UNSEEN_PHOTOS)
    return [crops(chunk, flaws, generator) for chunk in chunks]


@torch.no_grad()
def _measured(
    model: MaskNetwork, average: AveragedModel, unseen: list[Crops], where: torch.device
) -> dict[str, float]:
    found = []
    for seen in unseen:
        images = seen.images.to(where, memory_format=torch.channels_last)
        maps = model.taps((images - 127.0) / 128.0)
        average.module.eval()
        logits, _ = cast(Any, average.module)(maps, seen.boxes.to(where))
        found.append(ious(logits, seen.masks.to(where)))
    every = torch.cat(found)
    return {
        "iou": float(every.mean()),
        "median": float(every.median()),
        "over90": float((every >= 0.9).float().mean()),
    }


def _save(
    path: Path,
    model: MaskNetwork,
    average: AveragedModel,
    optimiser: torch.optim.Optimizer,
    step: int,
    photos: int,
) -> None:
    data = io.BytesIO()
    torch.save(
        {
            "step": step,
            "photos": photos,
            "decoder": model.decoder.state_dict(),
            "average": average.module.state_dict(),
            "averaged": int(average.n_averaged),
            "optimiser": optimiser.state_dict(),
        },
        data,
    )
    write_atomic(path, data.getvalue())


def _resumed(
    path: Path, model: MaskNetwork, average: AveragedModel, optimiser: torch.optim.Optimizer
) -> tuple[int, int]:
    content = read_checkpoint(path)
    set_weights(model.decoder, tensors(content.get("decoder"), str(path)), str(path))
    set_weights(average.module, tensors(content.get("average"), str(path)), str(path))
    average.n_averaged.fill_(int(content.get("averaged", 0)))
    set_optimiser(optimiser, content, path)
    return int(content["step"]), int(content["photos"])
