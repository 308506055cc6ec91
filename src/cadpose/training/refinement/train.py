"""Train the refinement network on pairs of synthetic photos and drawn models."""

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
from cadpose.rotation.features import STEPS
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.checkpoints import read_checkpoint, set_optimiser, set_weights, tensors
from cadpose.training.devices import keep_memory, torch_device
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.folder import begin
from cadpose.training.lite.sources import Sources, sources
from cadpose.training.lite.stream import Source, one_thread
from cadpose.training.refinement.export import export
from cadpose.training.refinement.network import CELLS, UNITS, StepNetwork
from cadpose.training.refinement.pairs import Pairs, PairStream
from cadpose.training.ring import Ring

CHECKPOINT, NETWORK = "checkpoint.pt", "refinement.onnx"
UNSEEN_PHOTOS = 480
#: Noise on the photo's standardised map, of each value and of each channel as a whole: other cameras.
NOISE = 0.15
#: Weight of the loss of the error that the network expects, and the most that one number of a step counts.
_ERROR_WEIGHT, _MOST_LOSS = 0.05, 6.0


@dataclass(frozen=True)
class Recipe:
    """How to train; unless told, as the shipped network was trained.

    Attributes:
        steps: Optimiser steps.
        batch: Pairs a step.
        fresh: New pairs a step that enter the buffer.
        buffer: Pairs kept; one takes 44 kB.
        rate: Learning rate at its peak.
        decay: Weight decay.
        warmup: Steps until the peak.
        ema: Decay of the weights' moving average, which is what is shipped.
        seed: Of weights, batches and pairs.
        validate_every: Steps between looks at unseen models.
    """

    steps: int = 10_000
    batch: int = 64
    fresh: int = 7
    buffer: int = 60_000
    rate: float = 2e-3
    decay: float = 0.02
    warmup: int = 200
    ema: float = 0.998
    seed: int = 0
    validate_every: int = 1000


def pair_sources(library: Library, backgrounds: Path | None, seed: int) -> Sources:
    """As for rotations, of all categories; unseen models are photographed as the library has them."""
    drawn = sources(library, backgrounds, seed, frontless=True)

    def near(source: Source, **changes: Any) -> Source:
        options = replace(
            source.options, size=288, fill=(0.35, 0.92), company=0.25, occluder=0.2, truncate=0.06,
            degrade=0.25, distance=(1.3, 8.0), **changes,
        )  # fmt: skip
        return replace(source, options=options)

    unseen = drawn.unseen and near(drawn.unseen, warp=0.0, redress=0.0)
    return Sources(near(drawn.train, warp=0.4, redress=0.5), unseen)


def train(options: TrainingOptions, on_step: OnStep, **numbers: Any) -> TrainingReport:
    """Train by the options; checkpoint and curves are written as it goes, the network at the end.

    Args:
        options: ``library``, ``backgrounds``, ``steps`` and ``batch_size`` are used besides the common ones.
        on_step: Called after every step.
        **numbers: Other numbers of :class:`Recipe`.

    Raises:
        InputError: the library has nothing to learn from, or the folder holds another training.
        DependencyError: the device is not there.
    """
    where = torch_device(options.device)
    keep_memory()
    told: dict[str, Any] = {"steps": options.steps, "batch": options.batch_size, **numbers}
    recipe = Recipe(seed=options.seed, **{k: v for k, v in told.items() if v is not None})
    drawn = pair_sources(Library.open(options.library), options.backgrounds, options.seed)
    plain = {k: v for k, v in asdict(recipe).items() if k != "validate_every"}
    begin(options.out, {"architecture": "refinement", **drawn.to_json(), "recipe": plain}, options.resume)
    torch.manual_seed(recipe.seed)
    model = StepNetwork().to(where)
    average = moving_average(model, recipe.ema)
    optimiser = torch.optim.AdamW(model.parameters(), recipe.rate, weight_decay=recipe.decay)
    generator = torch.Generator(where).manual_seed(recipe.seed)
    checkpoint, step, photos = options.out / CHECKPOINT, 0, 0
    if options.resume and checkpoint.is_file():
        step, photos = _resumed(checkpoint, model, average, optimiser)
        generator.manual_seed(recipe.seed + step)
    curves, begun = Curves(options.out, step), step
    stream = PairStream(drawn.train, first=photos)
    incoming = _loader(stream, options.workers or os.cpu_count() or 1)
    unseen = list(PairStream(drawn.unseen, photos=UNSEEN_PHOTOS)) if drawn.unseen else []
    ring: Ring[Pairs] = Ring(recipe.buffer, where)
    start, entered = time.monotonic(), 0
    model.train()
    while step < recipe.steps:
        while ring.entered < max(recipe.batch * 4, (step - begun + 1) * recipe.fresh):
            ring.add(next(incoming))
            entered += stream.chunk
        for group in optimiser.param_groups:
            group["lr"] = recipe.rate * min(1.0, (step + 1) / recipe.warmup) * _cosine(step / recipe.steps)
        losses = _step(model, ring.draw(recipe.batch, generator), optimiser, generator)
        average.update_parameters(model)
        step += 1
        if step % 50 == 0:
            row = {"step": step, "entered": ring.entered, "seconds": round(time.monotonic() - start, 1)}
            curves.add(row | {name: float(value) for name, value in losses.items()})
        if step % recipe.validate_every == 0 or step == recipe.steps:
            _save(checkpoint, model, average, optimiser, step, photos + entered)
            if unseen:
                curves.add({"step": step, "unseen": True, **measured(average.module, unseen, where)})
        on_step(step, recipe.steps)
    curves.draw()
    rows = [row for row in curves.rows if row.get("unseen")]
    network = options.out / NETWORK
    export(checkpoint, network)
    return TrainingReport(network, checkpoint, curves.path, rows, rows[-1] if rows else None, None)


def seen(pairs: Pairs, where: torch.device) -> tuple[Tensor, Tensor, Tensor]:
    """Maps and cover of pairs as the network takes them."""

    def maps(cells: Tensor) -> Tensor:
        values = cells.to(where, torch.float32) / STEPS
        return values.transpose(1, 2).reshape(len(cells), -1, CELLS, CELLS)

    cover = pairs.cover.to(where, torch.float32) / 255.0
    return maps(pairs.photo), maps(pairs.view), cover.reshape(-1, 1, CELLS, CELLS)


def _cosine(share: float) -> float:
    return 0.5 * (1.0 + math.cos(math.pi * share))


def _step(
    model: StepNetwork, pairs: Pairs, optimiser: torch.optim.Optimizer, generator: torch.Generator
) -> dict[str, Tensor]:
    photo, view, cover = seen(pairs, generator.device)
    for shape in (photo.shape, (*photo.shape[:2], 1, 1)):
        photo = photo + NOISE * torch.randn(shape, generator=generator, device=photo.device)
    true = pairs.step / torch.tensor(UNITS, device=photo.device)
    told, expected = model(photo, view, cover)
    lost = functional.smooth_l1_loss(told, true, reduction="none", beta=0.3).clamp(max=_MOST_LOSS).mean()
    off = (told[:, :3] - true[:, :3]).detach().norm(dim=1)
    doubt = functional.l1_loss(torch.log(expected + 0.1), torch.log(off + 0.1))
    optimiser.zero_grad(set_to_none=True)
    torch.autograd.backward([lost + _ERROR_WEIGHT * doubt])
    torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
    optimiser.step()
    return {"loss": lost.detach(), "doubt": doubt.detach()}


@torch.no_grad()
def measured(model: torch.nn.Module, pairs: list[Pairs], where: torch.device) -> dict[str, float]:
    """Angles in degrees before and after one step, of poses within 20°; medians and shares."""
    model.eval()
    units = torch.tensor(UNITS)
    before, after, focal = [], [], []
    for chunk in pairs:
        told = cast(Any, model)(*seen(chunk, where))[0].cpu() * units
        before.append(chunk.step[:, :3].norm(dim=1))
        # Small turns add up as vectors do; at 20 degrees that is off by less than one.
        after.append((told - chunk.step)[:, :3].norm(dim=1))
        focal.append((told - chunk.step)[:, 3].abs())
    a, b = (torch.rad2deg(torch.cat(part)) for part in (before, after))
    near = a <= 20.0
    return {
        "before": float(a[near].median()),
        "median": float(b[near].median()),
        "within5": float((b[near] <= 5.0).float().mean()),
        "within10": float((b[near] <= 10.0).float().mean()),
        "focal": float(torch.cat(focal)[near].median()),
    }


def _loader(stream: PairStream, workers: int) -> Iterator[Pairs]:
    # A forked process would wait for ever for OpenCV's threads, which stay behind.
    cv2.setNumThreads(1)
    return iter(
        DataLoader(stream, batch_size=None, num_workers=workers, prefetch_factor=2, worker_init_fn=one_thread)
    )


def _save(
    path: Path,
    model: StepNetwork,
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
            "network": model.state_dict(),
            "average": average.module.state_dict(),
            "averaged": int(average.n_averaged),
            "optimiser": optimiser.state_dict(),
        },
        data,
    )
    write_atomic(path, data.getvalue())


def _resumed(
    path: Path, model: StepNetwork, average: AveragedModel, optimiser: torch.optim.Optimizer
) -> tuple[int, int]:
    content = read_checkpoint(path)
    set_weights(model, tensors(content.get("network"), str(path)), str(path))
    set_weights(average.module, tensors(content.get("average"), str(path)), str(path))
    average.n_averaged.fill_(int(content.get("averaged", 0)))
    set_optimiser(optimiser, content, path)
    return int(content["step"]), int(content["photos"])
