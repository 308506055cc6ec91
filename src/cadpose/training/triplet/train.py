"""The training of the triplet baseline: SGD over photos, each with one positive and ten negatives.

A step's photos pass through the networks one after the other and their gradients add up, which without
BatchNorm is the same as all at once and takes a sixth of the memory.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import torch

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.records import CadModel
from cadpose.rendering import Renderer
from cadpose.rendering.raster import Rasteriser
from cadpose.training.architectures import OnStep
from cadpose.training.checkpoints import (
    damaged,
    read_resumable,
    set_optimiser,
    set_weights,
    tensors,
    write_checkpoint,
)
from cadpose.training.devices import repeatable_device
from cadpose.training.triplet.data import (
    Example,
    Pictures,
    Shown,
    digest,
    shown,
    training_examples,
    validation_examples,
)
from cadpose.training.triplet.export import export_onnx
from cadpose.training.triplet.loading import load_initial
from cadpose.training.triplet.loss import distances, triplet_losses
from cadpose.training.triplet.negatives import draw_negatives, nearest
from cadpose.training.triplet.network import TwoEncoders
from cadpose.training.triplet.options import TripletOptions, TripletReport
from cadpose.training.triplet.recipe import RECIPE, Recipe
from cadpose.training.triplet.validate import validate

log = logging.getLogger(__name__)


def train(
    options: TripletOptions,
    on_step: OnStep,
    recipe: Recipe | None = None,
    renderer: Renderer | None = None,
) -> TripletReport:
    """Train, writing the checkpoint and the curves after every epoch, and export at the end.

    Args:
        options: What to train on and where to write.
        on_step: Called after every step.
        recipe: The method's numbers, :data:`RECIPE` unless told.
        renderer: Draws the CAD models in place of the one that the options name.

    Raises:
        InputError: labels, photos or weights cannot be used, or the folder holds another training.
        LibraryError: there is no library, or a mesh is damaged.
        DependencyError: the device or the weights to start from are not there.
    """
    recipe = recipe or RECIPE
    if options.trained_blocks is not None:
        recipe = replace(recipe, trained_blocks=options.trained_blocks)
    device = repeatable_device(options.device)
    library = Library.open(options.library)
    examples = training_examples(options.data, library)
    measured = validation_examples(options.validation, library) if options.validation else []
    models = library.models()
    others = [_others(models, example.cad) for example in examples]
    unmasked = sum(x.label.mask is None for x in examples) if recipe.framing.masked else 0
    if unmasked:
        log.warning("%d of %d photos have no mask: their background stays", unmasked, len(examples))
    batch_size = min(options.batch_size or recipe.batch_size, len(examples))
    epochs = options.epochs or recipe.epochs
    pictures = Pictures(library, renderer or _renderer(options.renderer), recipe.framing)
    settings = _settings(recipe, options, batch_size, examples, pictures)

    network, optimiser = _made(recipe, options.seed, device)
    file, curves = options.out / "checkpoint.pt", options.out / "curves.jsonl"
    progress = Progress([], [[] for _ in examples], options.init)
    if options.resume:
        progress = _restore(file, settings, network, optimiser, len(examples), len(models))
    elif file.exists():
        raise InputError(f"{options.out}: holds a training already, add --resume or name another folder")
    else:
        load_initial(network, options.init)
    if progress.initial == "random":
        log.warning("the encoders start from random weights, not from ImageNet's as published")
    # Before the first epoch, which may take hours: a folder that cannot be made is told at once.
    options.out.mkdir(parents=True, exist_ok=True)

    steps = -(-len(examples) // batch_size)
    table: dict[str, Any] | None = None
    for epoch in range(len(progress.rows) + 1, epochs + 1):
        rng = np.random.default_rng((options.seed, epoch))
        order = rng.permutation(len(examples)).tolist()
        negatives = [
            draw_negatives(own, kept, recipe.negatives, rng)
            for own, kept in zip(others, progress.kept, strict=True)
        ]
        stream = shown(examples, order, negatives, models, pictures, options.workers)
        begun = (epoch - 1) * steps
        row, near = _epoch(network, optimiser, stream, recipe, batch_size, on_step, begun, epochs * steps)
        if options.mining:
            progress.kept = [near[i] for i in range(len(examples))]
        if measured:
            table = validate(network, measured, pictures, options.workers)
            row |= {f"val_{key}": table[key] for key in ("top1", "top3")}
        progress.rows.append({"epoch": epoch, "rate": recipe.rate, **row})
        _save(file, settings, network, optimiser, progress)
        write_atomic(curves, "".join(json.dumps(r) + "\n" for r in progress.rows).encode("ascii"))
    if measured and table is None:  # resumed after the last epoch
        table = validate(network, measured, pictures, options.workers)
    exported = options.out / "triplet.onnx"
    difference = export_onnx(network, recipe.framing, exported)
    return TripletReport(
        network=exported,
        checkpoint=file,
        curves=curves,
        initial=progress.initial,
        photos=len(examples),
        unmasked=unmasked,
        epochs=progress.rows,
        validation=table,
        difference=difference,
    )


@dataclass
class Progress:
    """How far a training has come, beside its weights.

    Attributes:
        rows: Curves, one row an epoch.
        kept: Of each example the models that it must be told apart from again.
        initial: What the weights started from.
    """

    rows: list[dict[str, float]]
    kept: list[list[int]]
    initial: str


def _renderer(name: str) -> Renderer:
    if name == "blender":
        from cadpose.rendering.blender import BlenderRenderer

        return BlenderRenderer()
    return Rasteriser()


def _made(recipe: Recipe, seed: int, device: torch.device) -> tuple[TwoEncoders, torch.optim.Optimizer]:
    """Encoders with random weights that the seed decides, and what trains them."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = TwoEncoders(recipe.width, recipe.normalise).to(device)
    network.train_blocks(recipe.trained_blocks)
    optimiser = torch.optim.SGD(
        network.trained(), recipe.rate, momentum=recipe.momentum, weight_decay=recipe.weight_decay
    )
    return network, optimiser


def _others(models: Sequence[CadModel], cad: CadModel) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Numbers of the models that look otherwise."""
    others = np.array([i for i, m in enumerate(models) if m.sha256 != cad.sha256], np.int64)
    if not len(others):
        raise InputError(
            f"the library holds no other CAD model than {cad.id}: add more with `cadpose library add`"
        )
    return others


def _settings(
    recipe: Recipe, options: TripletOptions, batch_size: int, examples: Sequence[Example], pictures: Pictures
) -> dict[str, Any]:
    """What must be the same when a training goes on."""
    told = asdict(recipe) | {"batch_size": batch_size, "seed": options.seed, "mining": options.mining}
    told |= {
        "data": digest(examples),
        "library": pictures.library.digest,
        "renderer": pictures.renderer.name,
    }
    del told["epochs"]  # a training may be prolonged
    settings: dict[str, Any] = json.loads(json.dumps(told))
    return settings


def _epoch(
    network: TwoEncoders,
    optimiser: torch.optim.Optimizer,
    stream: Iterator[Shown],
    recipe: Recipe,
    batch_size: int,
    on_step: OnStep,
    begun: int,
    steps: int,
) -> tuple[dict[str, float], dict[int, list[int]]]:
    """Train over the photos; the means over all triplets, and the nearest negatives of each example."""
    network.train()
    losses, positives, negatives = [], [], []
    near: dict[int, list[int]] = {}
    while batch := list(islice(stream, batch_size)):
        optimiser.zero_grad(set_to_none=True)
        triplets = sum(len(photo.models) for photo in batch)
        for photo in batch:
            loss, apart = photo_losses(network, photo, recipe.margin)
            if not torch.isfinite(loss).all():
                raise InputError("the training diverged (its loss is no number): start from other weights")
            (loss.sum() / triplets).backward()  # type: ignore[no-untyped-call]
            found = apart.detach().double().cpu().numpy()
            near[photo.index] = nearest(photo.models, found[1:], recipe.mined)
            losses.append(loss.detach().double().cpu().numpy())
            positives.append(found[0])
            negatives.append(found[1:])
        optimiser.step()
        begun += 1
        on_step(begun, steps)
    each = np.concatenate(losses)
    row = {
        "loss": float(each.mean()),
        "violations": float((each > 0).mean()),
        "positive": float(np.mean(positives)),
        "negative": float(np.concatenate(negatives).mean()),
    }
    return row, near


def photo_losses(network: TwoEncoders, photo: Shown, margin: float) -> tuple[torch.Tensor, torch.Tensor]:
    """(N,) losses of a photo's triplets, and its (1 + N,) distances, the positive's first."""
    device = next(network.parameters()).device
    images = (torch.from_numpy(x).to(device) for x in (photo.photo, photo.renders))
    apart = distances(*network(*images))
    return triplet_losses(apart, margin), apart


def _save(
    file: Path,
    settings: dict[str, Any],
    network: TwoEncoders,
    optimiser: torch.optim.Optimizer,
    progress: Progress,
) -> None:
    weights = {"photo": network.photo.state_dict(), "render": network.render.state_dict()}
    more = {"kept": progress.kept, "initial": progress.initial}
    write_checkpoint(file, settings, optimiser, progress.rows, {**weights, **more})


def _restore(
    file: Path,
    settings: dict[str, Any],
    network: TwoEncoders,
    optimiser: torch.optim.Optimizer,
    examples: int,
    models: int,
) -> Progress:
    """Set network and optimiser as they were; how far the training had come."""
    content = read_resumable(file, settings)
    for name, encoder in (("photo", network.photo), ("render", network.render)):
        set_weights(encoder, tensors(content.get(name), str(file)), str(file))
    set_optimiser(optimiser, content, file)
    kept, initial = content.get("kept"), content.get("initial")
    if not isinstance(kept, list) or len(kept) != examples or not isinstance(initial, str):
        raise damaged(file)
    for own in kept:
        if not isinstance(own, list) or not all(isinstance(i, int) and 0 <= i < models for i in own):
            raise damaged(file)
    return Progress(content["rows"], kept, initial)
