"""The training loop: fresh synthetic objects flow through a buffer from which batches are drawn.

Drawing a photo takes longer than learning from it, so that each is learned from several times, each time cut
out and spoiled differently. With the same seed, options and number of workers the same objects come in the
same order.
"""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from cadpose.errors import CadposeError
from cadpose.library.storage import write_atomic
from cadpose.training.lite.augment import Augmentation, crops
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.network import LitePose, normalised
from cadpose.training.lite.objective import Targets, contrast, pose_loss
from cadpose.training.lite.stream import Objects, ObjectStream, Source, loader
from cadpose.training.lite.validate import errors, summary

CHECKPOINT = "checkpoint.pt"


@dataclass(frozen=True)
class Recipe:
    """How to train.

    Attributes:
        steps: Optimiser steps.
        batch: Objects a step; each is seen in two crops.
        fresh: New objects a step that enter the buffer.
        buffer: Objects kept, a multiple of ``fresh`` or not.
        rate: Learning rate of the new layers at its peak.
        backbone_share: The backbone's share of it.
        decay: Weight decay.
        warmup: Steps until the peak.
        ema: Decay of the weights' moving average, which is what is shipped.
        contrast: Weight of the contrastive loss.
        unknown: Chance that the network is not told the category.
        seed: Of weights, batches and crops; the photos have their own in ``Source``.
        workers: Processes that draw photos.
        validate_every: Steps between looks at unseen models.
        augmentation: Crops.
        seconds: Stop by then, the learning rate falling by the clock; None trains all steps.
    """

    steps: int = 20_000
    batch: int = 256
    fresh: int = 128
    buffer: int = 60_000
    rate: float = 2e-3
    backbone_share: float = 0.5
    decay: float = 0.02
    warmup: int = 300
    ema: float = 0.999
    contrast: float = 1.0
    unknown: float = 0.2
    seed: int = 0
    workers: int = 2
    validate_every: int = 1000
    augmentation: Augmentation = field(default_factory=Augmentation)
    seconds: float | None = None


class Buffer:
    """The newest objects, on the device that trains."""

    def __init__(self, capacity: int, size: int, device: torch.device) -> None:
        self.capacity, self.filled, self.entered = capacity, 0, 0
        photos = torch.empty((capacity, 3, size, size), dtype=torch.uint8, device=device)
        self.kept = Objects(
            photos,
            torch.empty((capacity, 4), device=device),
            torch.empty((capacity, 4), device=device),
            torch.empty((capacity, 3), device=device),
            torch.empty(capacity, dtype=torch.int64, device=device),
            torch.empty(capacity, dtype=torch.int64, device=device),
        )

    def add(self, chunk: Objects) -> None:
        """Put a chunk in the place of the oldest objects."""
        at = torch.arange(self.entered, self.entered + len(chunk)) % self.capacity
        at = at.to(self.kept.turns.device)
        for kept, new in zip(self.kept.fields(), chunk.fields(), strict=True):
            kept[at] = new.to(kept.device, non_blocking=True)
        self.entered += len(chunk)
        self.filled = min(self.entered, self.capacity)

    def draw(self, count: int, generator: torch.Generator) -> Objects:
        """``count`` objects at random."""
        device = self.kept.turns.device
        at = torch.randint(self.filled, (count,), generator=generator, device=device)
        return Objects(*(t[at] for t in self.kept.fields()))


def train(
    source: Source,
    recipe: Recipe,
    out: Path,
    *,
    validation: Source | None = None,
    validation_photos: int = 1500,
    backbone: str = "lite0",
    device: str = "cpu",
    resume: bool = False,
    on_step: Callable[[int, dict[str, float]], None] = lambda _step, _row: None,
) -> LitePose:
    """Train and return the averaged network; checkpoint and curves are in ``out``.

    Raises:
        CadposeError: ``out`` holds a checkpoint of another recipe.
    """
    torch.manual_seed(recipe.seed)
    where = torch.device(device)
    if where.type == "cuda":
        torch.backends.cudnn.allow_tf32 = True
        torch.set_float32_matmul_precision("high")
    model = LitePose(source.categories, backbone).to(where)
    average = moving_average(model, recipe.ema)
    optimiser = torch.optim.AdamW(
        model.parameter_groups(recipe.rate, recipe.backbone_share),
        weight_decay=recipe.decay,
        fused=where.type == "cuda",
    )
    peaks = [group["lr"] for group in optimiser.param_groups]
    generator = torch.Generator(where).manual_seed(recipe.seed)
    out.mkdir(parents=True, exist_ok=True)
    told = {"backbone": backbone, "categories": source.categories, "recipe": plain(recipe)}
    step, photos = 0, 0
    if resume and (out / CHECKPOINT).is_file():
        step, photos = _load(out / CHECKPOINT, told, model, average, optimiser, where)
        generator.manual_seed(recipe.seed + step)
    curves, begun = Curves(out, step), step
    stream_of = ObjectStream(source, first=photos)
    stream = loader(stream_of, recipe.workers, pin=where.type == "cuda")
    # Drawn here, while the workers begin.
    unseen = _validation(validation, validation_photos)
    buffer = Buffer(recipe.buffer, source.options.size, where)
    start = time.monotonic()
    model.train()
    chunk_photos, waited = 0, 0.0
    while step < recipe.steps:
        before = time.monotonic()
        chunk_photos += _fill(buffer, stream, recipe, step - begun, stream_of.chunk)
        waited += time.monotonic() - before
        share = step / recipe.steps
        if recipe.seconds is not None:
            share = max(share, (time.monotonic() - start) / recipe.seconds)
            if share >= 1.0:
                break
        for group, peak in zip(optimiser.param_groups, peaks, strict=True):
            group["lr"] = peak * min(1.0, (step + 1) / recipe.warmup) * 0.5 * (1 + math.cos(math.pi * share))
        losses = _step(model, buffer.draw(recipe.batch, generator), recipe, optimiser, generator)
        average.update_parameters(model)
        step += 1
        if step % 50 == 0:
            row = {"step": step, "entered": buffer.entered, "seconds": round(time.monotonic() - start, 1)}
            row |= {"waited": round(waited, 1)} | {name: float(value) for name, value in losses.items()}
            curves.add(row)
            on_step(step, row)
        if step % recipe.validate_every == 0 and step < recipe.steps:
            _checkpoint(out, told, model, average, optimiser, step, photos + chunk_photos)
            if unseen:
                _report(curves, average.module, unseen, where, step, on_step)
    _checkpoint(out, told, model, average, optimiser, step, photos + chunk_photos)
    if unseen:
        _report(curves, average.module, unseen, where, step, on_step)
    trained = average.module.eval()
    assert isinstance(trained, LitePose)
    return trained


def _fill(buffer: Buffer, stream: Iterator[Objects], recipe: Recipe, step: int, chunk: int) -> int:
    """Let in what is due after ``step`` steps of this run, at least a batch; returns the number of photos."""
    due = max(recipe.batch * 4, (step + 1) * recipe.fresh)
    photos = 0
    while buffer.entered < due:
        buffer.add(next(stream))
        photos += chunk
    return photos


def _step(
    model: LitePose,
    drawn: Objects,
    recipe: Recipe,
    optimiser: torch.optim.Optimizer,
    generator: torch.Generator,
) -> dict[str, Tensor]:
    targets = Targets(drawn.angles, drawn.turns)
    both = [
        crops(drawn.photos, drawn.boxes, drawn.visible_boxes, targets, recipe.augmentation, generator)
        for _ in range(2)
    ]
    images = normalised(torch.cat([c for c, _ in both]))
    n = len(drawn)
    one_hot = functional.one_hot(drawn.category, len(model.categories)).float()
    draw = torch.rand(n, generator=generator, device=one_hot.device)
    one_hot = one_hot * (draw >= recipe.unknown).float()[:, None]
    logits, offsets, features = model(images, one_hot.repeat(2, 1))
    merged = Targets(torch.cat([t.angles for _, t in both]), drawn.turns.repeat(2))
    pose = pose_loss(logits, offsets, merged)
    # The two crops of a photo may be mirrored and turned differently: only those alike are positives.
    alike = ((both[0][1].angles - both[1][1].angles).abs().amax(dim=1) < 15.0).nonzero()[:, 0]
    near = contrast(
        features[:n][alike], features[n:][alike], Targets(both[0][1].angles[alike], drawn.turns[alike])
    )
    loss = pose + recipe.contrast * near
    optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
    optimiser.step()
    return {"pose": pose.detach(), "contrast": near.detach()}


def _validation(source: Source | None, photos: int) -> list[Objects]:
    if source is None or not source.models:
        return []
    return list(ObjectStream(source, photos=photos, main_only=True))


def _report(
    curves: Curves,
    model: Any,
    unseen: list[Objects],
    where: torch.device,
    step: int,
    on_step: Callable[[int, dict[str, float]], None],
) -> None:
    row = {"step": step, "unseen": True, **summary(*errors(model, unseen, where), model.categories)}
    curves.add(row)
    on_step(step, row)


def plain(recipe: Recipe) -> dict[str, Any]:
    """What must be the same when a training goes on."""
    told = asdict(recipe)
    for name in ("seconds", "workers", "validate_every"):
        told.pop(name)
    return told


def _checkpoint(
    out: Path,
    told: dict[str, Any],
    model: LitePose,
    average: AveragedModel,
    optimiser: torch.optim.Optimizer,
    step: int,
    photos: int,
) -> None:
    data = io.BytesIO()
    state = {
        "told": json.dumps(told),
        "step": step,
        "photos": photos,
        "model": model.state_dict(),
        "average": average.state_dict(),
        "optimiser": optimiser.state_dict(),
    }
    torch.save(state, data)
    write_atomic(out / CHECKPOINT, data.getvalue())


def _load(
    path: Path,
    told: dict[str, Any],
    model: LitePose,
    average: AveragedModel,
    optimiser: torch.optim.Optimizer,
    where: torch.device,
) -> tuple[int, int]:
    try:
        state = torch.load(path, map_location=where, weights_only=True)
        if state["told"] != json.dumps(told):
            raise CadposeError(
                f"{path} was made with another recipe: choose a new folder, or the same options"
            )
        model.load_state_dict(state["model"])
        average.load_state_dict(state["average"])
        optimiser.load_state_dict(state["optimiser"])
        return int(state["step"]), int(state["photos"])
    except CadposeError:
        raise
    except Exception as error:  # a damaged archive raises nearly anything
        raise CadposeError(
            f"{path} is damaged ({type(error).__name__}): delete it and train from the beginning"
        ) from error


def trained_network(path: Path) -> LitePose:
    """The averaged network of a checkpoint.

    Raises:
        CadposeError: the file is no checkpoint of this kind.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        told = json.loads(state["told"])
        model = LitePose(told["categories"], told["backbone"], pretrained=False)
        average = {k.removeprefix("module."): v for k, v in state["average"].items() if k != "n_averaged"}
        model.load_state_dict(average)
    except CadposeError:
        raise
    except Exception as error:  # a damaged archive raises nearly anything
        raise CadposeError(f"{path} is no checkpoint of this network ({error})") from error
    return model.eval()
