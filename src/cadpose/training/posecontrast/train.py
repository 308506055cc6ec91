"""The training of PoseContrast, and the export of its checkpoints.

Verified in the authors' published code (src/train.py, scripts/train.sh): Adam, its rates and weight decay, 15
epochs of batches of 32 without the last incomplete one, a rate of a tenth from the twelfth epoch on, the
mirrored and the turned copies in the angle loss only, and the positives in a forward pass of their own.
Their two optimisers, alike for encoder and heads, are one here. The difference lies in the order of crops
within a batch, which means nothing.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from cadpose.datasets.labels import Label
from cadpose.errors import InputError
from cadpose.evaluation.rotation import rotation_result, rotation_table
from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.frames import FloatArray
from cadpose.library.storage import write_atomic
from cadpose.records import Rotation
from cadpose.rotation.bins import angles_from_labels, decode
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.checkpoints import (
    read_checkpoint,
    read_resumable,
    set_optimiser,
    write_checkpoint,
)
from cadpose.training.devices import repeatable_device
from cadpose.training.losses import TEMPERATURE, angle_loss, pose_aware_nce
from cadpose.training.posecontrast.data import (
    Batch,
    digest,
    plain_batches,
    training_batches,
    training_labels,
    validation_labels,
)
from cadpose.training.posecontrast.export import export_onnx
from cadpose.training.posecontrast.loading import CHECKPOINTS, load_initial, load_weights
from cadpose.training.posecontrast.network import Outputs, PoseContrast, normalised

log = logging.getLogger(__name__)

#: Most blocks a stage, first channels and channels of the heads that a checkpoint may ask memory for.
_MOST_BLOCKS, _MOST_WIDTH, _MOST_HIDDEN = 36, 128, 4096


@dataclass(frozen=True, slots=True)
class Recipe:
    """Numbers of the method; the published ones are the defaults.

    Attributes:
        epochs: Passes over the data.
        batch_size: Photos a step; each gives four crops.
        rate: Adam's learning rate.
        weight_decay: Adam's weight decay, added to the gradient.
        slower_from: Epoch, counted from 1, from which on the rate is a tenth.
        contrast: Factor of the contrastive loss.
        weighting: Of the contrastive loss, see :data:`cadpose.training.losses.WEIGHTINGS`.
        temperature: Of the contrastive loss.
        blocks: Of the encoder; ResNet-50.
        width: Of the encoder.
        hidden: Of the heads.
    """

    epochs: int = 15
    batch_size: int = 32
    rate: float = 1e-4
    weight_decay: float = 5e-4
    slower_from: int = 12
    contrast: float = 1.0
    weighting: str = "linear"
    temperature: float = TEMPERATURE
    blocks: tuple[int, ...] = (3, 4, 6, 3)
    width: int = 64
    hidden: tuple[int, ...] = (800, 400, 200)

    def network(self, seed: int) -> PoseContrast:
        """The network with random weights that the seed decides."""
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(seed)
            return PoseContrast(self.blocks, self.width, self.hidden)

    def rate_in(self, epoch: int) -> float:
        """Learning rate of an epoch, counted from 1."""
        return self.rate * (0.1 if epoch >= self.slower_from else 1.0)


#: The published recipe.
RECIPE = Recipe()


def train(options: TrainingOptions, on_step: OnStep, recipe: Recipe | None = None) -> TrainingReport:
    """Train, writing the checkpoint and the curves after every epoch, and export at the end.

    Args:
        options: What to train on and where to write.
        on_step: Called after every step.
        recipe: The method's numbers, :data:`RECIPE` unless told.

    Raises:
        InputError: labels, photos or weights cannot be used, or the folder holds another training.
        DependencyError: the device or the weights to start from are not there.
    """
    recipe = recipe or RECIPE
    device = repeatable_device(options.device)
    if options.data is None:
        raise InputError("PoseContrast is trained on labelled photos: name a label file")
    labels = training_labels(options.data)
    measured = validation_labels(options.validation) if options.validation else []
    batch_size = min(options.batch_size or recipe.batch_size, len(labels))
    epochs = options.epochs or recipe.epochs
    settings = json.loads(json.dumps(asdict(recipe) | {"batch_size": batch_size, "seed": options.seed}))
    settings["data"] = digest(labels)
    del settings["epochs"]  # a training may be prolonged

    network = recipe.network(options.seed).to(device)
    optimiser = torch.optim.Adam(network.parameters(), recipe.rate, weight_decay=recipe.weight_decay)
    file, curves = options.out / "checkpoint.pt", options.out / "curves.jsonl"
    rows: list[dict[str, float]] = []
    if options.resume:
        rows = _restore(file, settings, network, optimiser)
    elif file.exists():
        raise InputError(f"{options.out}: holds a training already, add --resume or name another folder")
    else:
        started = load_initial(network, options.init or "moco")
        log.info("initial weights: %s (%s)", options.init or "moco", started)
    # Before the first epoch, which may take hours: a folder that cannot be made is told at once.
    options.out.mkdir(parents=True, exist_ok=True)

    steps = len(labels) // batch_size
    table: dict[str, Any] | None = None
    for epoch in range(len(rows) + 1, epochs + 1):
        row: dict[str, float] = {"epoch": epoch, "rate": recipe.rate_in(epoch)}
        for group in optimiser.param_groups:
            group["lr"] = row["rate"]
        network.train()
        batches = training_batches(labels, batch_size, options.seed, epoch, options.workers)
        row |= _epoch(
            network,
            optimiser,
            batches,
            recipe,
            lambda n, e=epoch: on_step((e - 1) * steps + n, epochs * steps),
        )
        if measured:
            table = validate(network, measured, batch_size, options.workers)
            row |= {f"val_{key}": table[key] for key in ("acc30", "mederr")}
        rows.append(row)
        _save(file, settings, network, optimiser, rows)
        write_atomic(curves, "".join(json.dumps(r) + "\n" for r in rows).encode("ascii"))
    if measured and table is None:  # resumed after the last epoch
        table = validate(network, measured, batch_size, options.workers)
    exported = options.out / "posecontrast.onnx"
    difference = export_onnx(network, exported)
    return TrainingReport(exported, file, curves, rows, table, difference)


def export(weights: str, path: Path, heads: Sequence[Path] = (), embedding: Path | None = None) -> float:
    """Write the network of a checkpoint as ONNX.

    Args:
        weights: The path of a checkpoint of cadpose or of the method's authors, or a key of
            :data:`cadpose.training.posecontrast.loading.CHECKPOINTS`.
        path: ONNX file to write.
        heads: Must be empty; this network has one member.
        embedding: Must be None; it embeds nothing.

    Returns:
        The largest difference between the exported network and torch's.

    Raises:
        InputError: the checkpoint cannot be used, or holds no heads.
        DependencyError: a named checkpoint is not there.
    """
    for extra in (*heads, *([] if embedding is None else [embedding])):
        raise InputError(f"{extra}: PoseContrast is one network, leave out --head and --embedding")
    recipe = RECIPE
    if weights not in CHECKPOINTS:
        settings = read_checkpoint(Path(weights)).get("settings")
        if isinstance(settings, dict):
            recipe = _told_recipe(settings, weights)
    network = recipe.network(0)
    if load_initial(network, weights) != "network":
        raise InputError(f"{weights}: holds an encoder without heads, train it first")
    return export_onnx(network, path)


def _told_recipe(settings: dict[str, Any], name: str) -> Recipe:
    """The layers that a checkpoint tells of, looked at before any is made."""
    try:
        blocks, hidden = (tuple(int(n) for n in settings[key]) for key in ("blocks", "hidden"))
        width = int(settings["width"])
    except (KeyError, TypeError, ValueError, OverflowError):
        raise InputError(f"{name}: is no checkpoint of this network") from None
    fits = len(blocks) == 4 and 1 <= len(hidden) <= 8 and min(*blocks, *hidden, width) >= 1
    if not fits or max(blocks) > _MOST_BLOCKS or width > _MOST_WIDTH or max(hidden) > _MOST_HIDDEN:
        raise InputError(f"{name}: tells of layers that no such network has")
    return Recipe(blocks=blocks, width=width, hidden=hidden)


@torch.no_grad()
def validate(network: PoseContrast, labels: list[Label], batch_size: int, workers: int = 0) -> dict[str, Any]:
    """Table of the rotation errors over labels, by class and overall; without the test-time flip."""
    network.eval()
    device = next(network.parameters()).device
    found = [
        _angles(network(normalised(torch.from_numpy(images).to(device))))
        for images in plain_batches(labels, batch_size, workers)
    ]
    results = [
        rotation_result(label, Rotation(*(float(a) for a in angles)))
        for label, angles in zip(labels, np.concatenate(found), strict=True)
    ]
    return rotation_table(results)


def loss_of(
    network: PoseContrast, batch: Batch, recipe: Recipe
) -> tuple[Tensor, dict[str, float], FloatArray]:
    """One batch's loss, its parts by name, and the (3 B,) errors of the angles in degrees."""
    device = next(network.parameters()).device
    images = [_seen(batch, i, device) for i in range(4)]
    labels = torch.from_numpy(batch.labels).to(device).reshape(-1, 3)
    outputs: Outputs = network(torch.cat(images[:3]))
    angles = angle_loss(outputs.logits, outputs.offsets, labels)
    loss, parts = angles, {"angle_loss": float(angles.detach())}
    if recipe.contrast:
        # In a pass of its own, as the authors do: BatchNorm sees the positives apart.
        positive = network.net_feat(images[3])
        query = outputs.features[: len(positive)]
        R = torch.from_numpy(batch.rotations()).to(device, query.dtype)
        contrast = pose_aware_nce(query, positive, R, recipe.weighting, recipe.temperature)
        loss, parts["contrast_loss"] = angles + recipe.contrast * contrast, float(contrast.detach())
    true = rotation_from_angles(*angles_from_labels(batch.labels.reshape(-1, 3)).T)
    errors = geodesic_degrees(rotation_from_angles(*_angles(outputs).T), true)
    return loss, parts | {"loss": float(loss.detach())}, errors


def _epoch(
    network: PoseContrast,
    optimiser: torch.optim.Optimizer,
    batches: Iterable[Batch],
    recipe: Recipe,
    on_step: Any,
) -> dict[str, float]:
    """Train over the batches; the means of the losses, and Acc@30 as a share of 1."""
    parts: list[dict[str, float]] = []
    errors: list[FloatArray] = []
    for done, batch in enumerate(batches, start=1):
        loss, part, error = loss_of(network, batch, recipe)
        if not torch.isfinite(loss):
            raise InputError("the training diverged (its loss is no number): start from other weights")
        optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        parts.append(part)
        errors.append(error)
        on_step(done)
    means = {key: float(np.mean([part[key] for part in parts])) for key in parts[0]}
    return means | {"acc30": float((np.concatenate(errors) <= 30.0).mean())}


def _seen(batch: Batch, view: int, device: torch.device) -> Tensor:
    images = normalised(torch.from_numpy(batch.images[view]).to(device))
    return images + torch.from_numpy(batch.lighting[view]).to(device)[:, :, None, None]


def _angles(outputs: Outputs) -> FloatArray:
    """(N, 3) decoded angles in degrees."""
    arrays = [[o.detach().double().cpu().numpy() for o in kind] for kind in outputs[1:]]
    return decode(*arrays)


def _save(
    file: Path,
    settings: dict[str, Any],
    network: PoseContrast,
    optimiser: torch.optim.Optimizer,
    rows: list[dict[str, float]],
) -> None:
    """Under the authors' names, so that one reader does for both; their last layer ``fc`` is not there."""
    content = {"net_feat": network.net_feat.state_dict(), "net_vp": network.net_vp.state_dict()}
    write_checkpoint(file, settings, optimiser, rows, content)


def _restore(
    file: Path, settings: dict[str, Any], network: PoseContrast, optimiser: torch.optim.Optimizer
) -> list[dict[str, float]]:
    """Set network and optimiser as they were; the rows of the epochs that are done."""
    content = read_resumable(file, settings)
    load_weights(network, content, str(file))
    set_optimiser(optimiser, content, file)
    return list(content["rows"])
