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
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from cadpose.errors import CadposeError
from cadpose.library.storage import write_atomic
from cadpose.training.lite.augment import GENTLE, Augmentation, crops
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.embedder import RenderQueue, matching_loss
from cadpose.training.lite.frozen import FrozenEncoder
from cadpose.training.lite.network import normalised
from cadpose.training.lite.networks import (
    Answer,
    EmbeddedNetworks,
    embedding_share,
    rotation_errors,
    shrunk,
)
from cadpose.training.lite.objective import Targets, contrast, pose_loss
from cadpose.training.lite.stream import Objects, ObjectStream, Source, loader
from cadpose.training.lite.validate import summary
from cadpose.training.ring import Ring

CHECKPOINT = "checkpoint.pt"
_UNSEEN_BATCH = 96
#: What a GPU computes in. cuDNN has its depthwise convolutions ready for these and compiles bfloat16's.
GPU_PRECISION, GPU_LAYOUT = torch.float16, torch.channels_last


@dataclass(frozen=True)
class Recipe:
    """How to train; unless told, as the shipped networks were trained.

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
        augmentations: Of the two crops: one as an ordinary photo has it, one with all flaws.
        seconds: Stop by then, the learning rate falling by the clock; None trains all steps.
    """

    steps: int = 2148
    batch: int = 256
    fresh: int = 192
    buffer: int = 120_000
    rate: float = 1.5e-3
    backbone_share: float = 0.5
    decay: float = 0.02
    warmup: int = 200
    ema: float = 0.998
    contrast: float = 1.0
    unknown: float = 0.2
    seed: int = 0
    workers: int = 2
    validate_every: int = 700
    augmentations: tuple[Augmentation, Augmentation] = (GENTLE, Augmentation())
    seconds: float | None = None


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
) -> EmbeddedNetworks:
    """Train members and view embedder and return their averages; checkpoint and curves are in ``out``.

    Raises:
        CadposeError: ``out`` holds a checkpoint of another recipe.
    """
    torch.manual_seed(recipe.seed)
    where = torch.device(device)
    layout = torch.contiguous_format
    if where.type == "cuda":
        torch.backends.cudnn.allow_tf32 = True
        torch.set_float32_matmul_precision("high")
        layout = GPU_LAYOUT
    # Module.to takes a memory format; its type hints do not know of it beside a device.
    model = EmbeddedNetworks(source.categories, backbone).to(where, memory_format=layout)  # type: ignore[call-overload]
    encoder = FrozenEncoder().to(where, memory_format=layout)  # type: ignore[call-overload]
    average = moving_average(model, recipe.ema)
    optimiser = torch.optim.AdamW(
        model.parameter_groups(recipe.rate, recipe.backbone_share),
        weight_decay=recipe.decay,
        fused=where.type == "cuda",
    )
    peaks = [group["lr"] for group in optimiser.param_groups]
    scaler = torch.amp.GradScaler(where.type, enabled=where.type == "cuda")
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
    ring: Ring[Objects] = Ring(recipe.buffer, where)
    queue = RenderQueue()
    start = time.monotonic()
    model.train()
    chunk_photos, waited = 0, 0.0
    while step < recipe.steps:
        before = time.monotonic()
        chunk_photos += _fill(ring, stream, recipe, step - begun, stream_of.chunk)
        waited += time.monotonic() - before
        share = step / recipe.steps
        if recipe.seconds is not None:
            share = max(share, (time.monotonic() - start) / recipe.seconds)
            if share >= 1.0:
                break
        for group, peak in zip(optimiser.param_groups, peaks, strict=True):
            group["lr"] = peak * min(1.0, (step + 1) / recipe.warmup) * 0.5 * (1 + math.cos(math.pi * share))
        drawn = ring.draw(recipe.batch, generator)
        losses = _step(model, encoder, drawn, recipe, optimiser, scaler, generator, queue)
        average.update_parameters(model)
        step += 1
        if step % 50 == 0:
            row = {"step": step, "entered": ring.entered, "seconds": round(time.monotonic() - start, 1)}
            row |= {"waited": round(waited, 1)} | {name: float(value) for name, value in losses.items()}
            curves.add(row)
            on_step(step, row)
        if step % recipe.validate_every == 0 and step < recipe.steps:
            _checkpoint(out, told, model, average, optimiser, step, photos + chunk_photos)
            if unseen:
                _report(curves, average.module, encoder, unseen, where, step, on_step)
    _checkpoint(out, told, model, average, optimiser, step, photos + chunk_photos)
    if unseen:
        _report(curves, average.module, encoder, unseen, where, step, on_step)
    trained = average.module.eval()
    assert isinstance(trained, EmbeddedNetworks)
    return trained


def _fill(ring: Ring[Objects], stream: Iterator[Objects], recipe: Recipe, step: int, chunk: int) -> int:
    """Let in what is due after ``step`` steps of this run, at least a batch; returns the number of photos."""
    due = max(recipe.batch * 4, (step + 1) * recipe.fresh)
    photos = 0
    while ring.entered < due:
        ring.add(next(stream))
        photos += chunk
    return photos


def _step(
    model: EmbeddedNetworks,
    encoder: FrozenEncoder,
    drawn: Objects,
    recipe: Recipe,
    optimiser: torch.optim.Optimizer,
    scaler: torch.amp.GradScaler,
    generator: torch.Generator,
    queue: RenderQueue,
) -> dict[str, Tensor]:
    n, targets = len(drawn), Targets(drawn.angles, drawn.turns)
    both = [
        crops(drawn.photos, drawn.boxes, drawn.visible_boxes, targets, augmentation, generator)
        for augmentation in recipe.augmentations
    ]
    images = normalised(torch.cat([c for c, _ in both]))
    on_gpu = images.device.type == "cuda"
    if on_gpu:
        images = images.contiguous(memory_format=GPU_LAYOUT)
    one_hot = functional.one_hot(drawn.category, len(model.categories)).float()
    draw = torch.rand(n, generator=generator, device=one_hot.device)
    one_hot = one_hot * (draw >= recipe.unknown).float()[:, None]
    with torch.autocast(images.device.type, GPU_PRECISION, enabled=on_gpu):
        answers = model(images, encoder(images), one_hot.repeat(2, 1))
        embedded = _embedded(model, images[:n], drawn, both[0][1])
    near = matching_loss(embedded[:n], embedded[n:], drawn.models, queue)
    lost = [_lost(answer, both[0][1], both[1][1], recipe) for answer in answers]
    optimiser.zero_grad(set_to_none=True)
    whole = torch.stack([near, *(loss for loss, _ in lost)]).sum()
    scaler.scale(whole).backward()  # type: ignore[no-untyped-call]
    scaler.unscale_(optimiser)
    for member in (model.tuned, model.head, model.embedder):
        torch.nn.utils.clip_grad_norm_(member.parameters(), 5.0)
    scaler.step(optimiser)
    scaler.update()
    told = zip(("pose", "head", "match"), (*(pose for _, pose in lost), near), strict=True)
    return {name: value.detach() for name, value in told}


def _embedded(model: EmbeddedNetworks, images: Tensor, drawn: Objects, cut: Targets) -> Tensor:
    """The first crops' embeddings and after them those of the renders, mirrored where the crops are."""
    mirrored = (cut.angles[:, 0] != drawn.angles[:, 0])[:, None, None, None]
    renders = torch.where(mirrored, drawn.renders.flip(3), drawn.renders)
    found: Tensor = model.embedder(torch.cat([shrunk(images), normalised(renders.float())]))
    return found


def _lost(answer: Answer, first: Targets, second: Targets, recipe: Recipe) -> tuple[Tensor, Tensor]:
    """One member's loss with and without the contrastive part."""
    logits, offsets, features = answer
    n = len(first.turns)
    merged = Targets(torch.cat([first.angles, second.angles]), first.turns.repeat(2))
    pose = pose_loss(logits, offsets, merged)
    # The two crops of a photo may be mirrored and turned differently: only those alike are positives.
    alike = ((first.angles - second.angles).abs().amax(dim=1) < 15.0).nonzero()[:, 0]
    near = contrast(
        features[:n][alike], features[n:][alike], Targets(first.angles[alike], first.turns[alike])
    )
    return pose + recipe.contrast * near, pose


def _validation(source: Source | None, photos: int) -> list[Objects]:
    if source is None or not source.models:
        return []
    chunks = list(ObjectStream(source, photos=photos, main_only=True))
    fields = [torch.cat(some) for some in zip(*(c.fields() for c in chunks), strict=True)]
    # Batches of one size: a GPU prepares each size anew.
    starts = range(0, len(fields[0]), _UNSEEN_BATCH)
    return [Objects(*(field[at : at + _UNSEEN_BATCH] for field in fields)) for at in starts]


def _report(
    curves: Curves,
    model: Any,
    encoder: FrozenEncoder,
    unseen: list[Objects],
    where: torch.device,
    step: int,
    on_step: Callable[[int, dict[str, float]], None],
) -> None:
    with torch.autocast(where.type, GPU_PRECISION, enabled=where.type == "cuda"):
        found, category = rotation_errors(model, encoder, unseen, where)
        first = embedding_share(model, unseen, where)
    alone = {f"{name}30": float((found[name] <= 30).float().mean()) for name in ("tuned", "head")}
    row = {"step": step, "unseen": True, **summary(found["both"], category, model.categories), **alone}
    row["match1"] = first
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
    model: EmbeddedNetworks,
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
    model: EmbeddedNetworks,
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


def trained_networks(path: Path) -> EmbeddedNetworks:
    """The averaged members of a checkpoint.

    Raises:
        CadposeError: the file is no checkpoint of this kind.
    """
    try:
        state = torch.load(path, map_location="cpu", weights_only=True)
        told = json.loads(state["told"])
        model = EmbeddedNetworks(told["categories"], told["backbone"], pretrained=False)
        average = {k.removeprefix("module."): v for k, v in state["average"].items() if k != "n_averaged"}
        model.load_state_dict(average)
    except CadposeError:
        raise
    except Exception as error:  # a damaged archive raises nearly anything
        raise CadposeError(f"{path} is no checkpoint of this network ({error})") from error
    return model.eval()
