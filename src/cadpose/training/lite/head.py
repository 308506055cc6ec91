"""A head on the frozen encoder's maps: what ImageNet taught the encoder about real photos stays as it is."""

from __future__ import annotations

import io
import json
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional
from torch.optim.swa_utils import AveragedModel

from cadpose.errors import InputError
from cadpose.library.storage import write_atomic
from cadpose.rotation.bins import BINS
from cadpose.rotation.features import LEVELS, STEPS
from cadpose.training.lite.average import moving_average
from cadpose.training.lite.curves import Curves
from cadpose.training.lite.maps import Maps
from cadpose.training.lite.objective import Targets, contrast, pose_loss
from cadpose.training.lite.validate import decoded, modulo, summary

CHECKPOINT = "checkpoint.pt"


class MapHead(nn.Module):
    """Maps at stride 16 and 32 and a category to logits and offsets, as :class:`LitePose` answers.

    Args:
        categories: Names in the order of the category input.
        wide: More channels and one more layer: for a GPU, and more photos than a CPU draws.
    """

    def __init__(self, categories: Sequence[str], wide: bool = False) -> None:
        super().__init__()
        self.categories, self.wide = tuple(categories), wide
        fine, coarse = LEVELS
        a, b, both, place = (128, 192, 224, 48) if wide else (96, 128, 160, 40)
        self.fine = nn.Sequential(_conv(fine.channels, a, 1), nn.Dropout2d(0.05), _conv(a, b, 3, stride=2))
        self.coarse = nn.Sequential(_conv(coarse.channels, 128, 1), nn.Dropout2d(0.05))
        self.both = nn.Sequential(
            _conv(b + 128, both, 1), *(_conv(both, both, 3) for _ in range(2 if wide else 1))
        )
        self.place = _conv(both, place, 1)
        self.category = nn.Linear(len(self.categories), 32)
        self.compress = nn.Sequential(
            nn.Linear(both + place * coarse.cells + 32, 512), nn.BatchNorm1d(512), nn.ReLU(), nn.Dropout(0.2),
            nn.Linear(512, 256), nn.BatchNorm1d(256), nn.ReLU(),
        )  # fmt: skip
        self.heads = nn.ModuleList([nn.Linear(256, 2 * bins) for bins in BINS])

    def forward(
        self, fine: Tensor, coarse: Tensor, category: Tensor
    ) -> tuple[list[Tensor], list[Tensor], Tensor]:
        """Logits, offsets and features.

        Args:
            fine: (N, 196, 112) cells of the stride-16 map in int8 steps, see ``rotation.features.describe``.
            coarse: (N, 49, 192) cells of the stride-32 map.
            category: (N, C) one-hot; zeros for an unknown category.
        """
        maps = [
            (cells.float() / STEPS).transpose(1, 2).reshape(-1, level.channels, level.side, level.side)
            for cells, level in zip((fine, coarse), LEVELS, strict=True)
        ]
        x = self.both(torch.cat([self.fine(maps[0]), self.coarse(maps[1])], dim=1))
        features = x.mean(dim=(2, 3))
        told = functional.relu(self.category(category))
        hidden = self.compress(torch.cat([features, self.place(x).flatten(1), told], dim=1))
        out = [head(hidden) for head in self.heads]
        logits = [o[:, :n] for o, n in zip(out, BINS, strict=True)]
        offsets = [o[:, n:] for o, n in zip(out, BINS, strict=True)]
        return logits, offsets, features


def _conv(into: int, out: int, side: int, stride: int = 1) -> nn.Sequential:
    return nn.Sequential(
        nn.Conv2d(into, out, side, stride=stride, padding=side // 2, bias=False),
        nn.BatchNorm2d(out),
        nn.ReLU(),
    )


@dataclass(frozen=True)
class HeadRecipe:
    """How to train the head.

    Attributes:
        epochs: Times that every kept crop is seen.
        batch: Objects a step, each in both of its crops.
        rate: Learning rate at its peak.
        decay: Weight decay.
        warmup: Steps until the peak.
        ema: Decay of the weights' moving average.
        contrast: Weight of the contrastive loss.
        unknown: Chance that the category is not told.
        seed: Of weights and batches.
        seconds: Stop by then, the learning rate falling by the clock; None sees all epochs.
    """

    epochs: int = 6
    batch: int = 128
    rate: float = 2e-3
    decay: float = 0.05
    warmup: int = 80
    ema: float = 0.99
    contrast: float = 0.5
    unknown: float = 0.2
    seed: int = 0
    seconds: float | None = None


def train_head(
    shards: Sequence[Path],
    categories: Sequence[str],
    recipe: HeadRecipe,
    *,
    unseen: Maps | None = None,
    device: str = "cpu",
    out: Path | None = None,
    resume: bool = False,
    on_step: Callable[[int, dict[str, float]], None] = lambda _step, _row: None,
) -> MapHead:
    """Train on shards of two crops an object, and return the averaged head.

    Args:
        shards: Files of :func:`~cadpose.training.lite.maps.draw_shards`; all are held in memory.
        categories: Names in the order of the category numbers.
        recipe: How.
        unseen: Crops to measure on after every epoch.
        device: Of torch.
        out: Folder for a checkpoint after every epoch and the curves; none are kept if None.
        resume: Go on from the checkpoint in ``out``, to the same end as without the pause.
        on_step: Called now and then with the step and a row of the curves.

    Raises:
        InputError: no object was drawn, or the checkpoint is of another training.
    """
    where = torch.device(device)
    data, first, second = _pairs(shards)
    if not len(first):
        raise InputError("no object worth learning from was drawn: draw more photos")
    batch = min(recipe.batch, len(first))
    torch.manual_seed(recipe.seed)
    model = MapHead(categories).to(where)
    average = moving_average(model, recipe.ema)
    optimiser = torch.optim.AdamW(model.parameters(), lr=recipe.rate, weight_decay=recipe.decay)
    told = json.dumps({"categories": list(categories), "recipe": asdict(recipe), "objects": len(first)})
    an_epoch = len(first) // batch
    steps = recipe.epochs * an_epoch
    step = 0
    if resume and out is not None and (out / CHECKPOINT).is_file():
        step = _restore(out / CHECKPOINT, told, model, average, optimiser)
    curves = Curves(out, step) if out is not None else None

    def report(row: dict[str, Any]) -> None:
        if curves is not None:
            curves.add({"step": step, **row})
        on_step(step, row)

    generator = torch.Generator(where)
    start, stopped = time.monotonic(), False
    model.train()
    while step < steps and not stopped:
        epoch = step // an_epoch
        # Each epoch's chances begin anew, so that a training that goes on ends as one without a pause.
        rng = np.random.default_rng((recipe.seed, epoch))
        generator.manual_seed(recipe.seed * 1_000_003 + epoch)
        torch.manual_seed(recipe.seed * 1_000_003 + epoch)
        for chosen in rng.permutation(len(first))[: an_epoch * batch].reshape(an_epoch, batch):
            share = step / steps
            if recipe.seconds is not None:
                share = max(share, (time.monotonic() - start) / recipe.seconds)
            if share >= 1.0:
                stopped = True
                break
            for group in optimiser.param_groups:
                group["lr"] = (
                    recipe.rate * min(1.0, (step + 1) / recipe.warmup) * 0.5 * (1 + math.cos(math.pi * share))
                )
            loss = _loss(model, data, first[chosen], second[chosen], recipe, generator, where)
            optimiser.zero_grad(set_to_none=True)
            loss.backward()  # type: ignore[no-untyped-call]
            torch.nn.utils.clip_grad_norm_(model.parameters(), 5.0)
            optimiser.step()
            average.update_parameters(model)
            step += 1
            if step % 100 == 0 or step == steps:
                seconds = round(time.monotonic() - start, 1)
                report({"loss": float(loss.detach()), "seconds": seconds, "steps": steps})
        if unseen is not None and len(unseen):
            averaged = average.module
            assert isinstance(averaged, MapHead)
            report({"unseen": True, **summary(*head_errors(averaged, unseen), categories)})
        if out is not None and not stopped:
            _checkpoint(out / CHECKPOINT, told, step, model, average, optimiser)
    trained = average.module.eval()
    assert isinstance(trained, MapHead)
    return trained.cpu()


def _checkpoint(
    path: Path,
    told: str,
    step: int,
    model: MapHead,
    average: AveragedModel,
    optimiser: torch.optim.Optimizer,
) -> None:
    data = io.BytesIO()
    state = {"told": told, "step": step, "model": model.state_dict(), "average": average.state_dict()}
    torch.save(state | {"optimiser": optimiser.state_dict()}, data)
    write_atomic(path, data.getvalue())


def _restore(
    path: Path, told: str, model: MapHead, average: AveragedModel, optimiser: torch.optim.Optimizer
) -> int:
    """Set everything as it was; the steps that are done."""
    try:
        state = torch.load(path, map_location=next(model.parameters()).device, weights_only=True)
        was, step = state["told"], int(state["step"])
    except Exception as error:  # a damaged archive raises nearly anything
        raise InputError(f"{path} is no checkpoint of a head ({error})") from error
    if was != told:
        raise InputError(f"{path} was made with another recipe or other photos: name another folder")
    model.load_state_dict(state["model"])
    average.load_state_dict(state["average"])
    optimiser.load_state_dict(state["optimiser"])
    return step


def _pairs(shards: Sequence[Path]) -> tuple[Maps, NDArray[np.int64], NDArray[np.int64]]:
    """All crops, and the numbers of the first and second crop of each object."""
    data, sizes = Maps.from_files(shards)
    first, at = [np.empty(0, np.int64)], 0
    second = list(first)
    for size in sizes:
        first.append(np.arange(at, at + size // 2))
        second.append(np.arange(at + size // 2, at + size))
        at += size
    return data, np.concatenate(first), np.concatenate(second)


def _loss(
    model: MapHead,
    data: Maps,
    first: NDArray[np.int64],
    second: NDArray[np.int64],
    recipe: HeadRecipe,
    generator: torch.Generator,
    where: torch.device,
) -> Tensor:
    both = np.concatenate([first, second])
    cells = [torch.from_numpy(c[both]).to(where) for c in data.cells]
    targets = Targets(
        torch.from_numpy(data.angles[both]).to(where), torch.from_numpy(data.turns[both]).to(where)
    )
    one_hot = functional.one_hot(
        torch.from_numpy(data.category[both]).to(where), len(model.categories)
    ).float()
    keep = torch.rand(len(both), generator=generator, device=where) >= recipe.unknown
    logits, offsets, features = model(cells[0], cells[1], one_hot * keep.float()[:, None])
    n = len(first)
    a, b = targets.angles[:n], targets.angles[n:]
    alike = ((a - b).abs().amax(dim=1) < 15.0).nonzero()[:, 0]
    near = contrast(features[:n][alike], features[n:][alike], Targets(a[alike], targets.turns[:n][alike]))
    return pose_loss(logits, offsets, targets) + recipe.contrast * near


@torch.no_grad()
def head_errors(model: MapHead, unseen: Maps, batch: int = 256) -> tuple[Tensor, Tensor]:
    """(M,) errors in degrees modulo symmetry about the upright axis, and (M,) category numbers."""
    was_training = model.training
    model.eval()
    where = next(model.parameters()).device
    found = []
    for at in range(0, len(unseen), batch):
        rows = slice(at, at + batch)
        cells = [torch.from_numpy(c[rows]).to(where) for c in unseen.cells]
        category = torch.from_numpy(unseen.category[rows]).to(where)
        one_hot = functional.one_hot(category, len(model.categories)).float()
        logits, offsets, _ = model(cells[0], cells[1], one_hot)
        targets = Targets(
            torch.from_numpy(unseen.angles[rows]).to(where), torch.from_numpy(unseen.turns[rows]).to(where)
        )
        found.append(modulo(decoded(logits, offsets), targets).cpu())
    model.train(was_training)
    return torch.cat(found), torch.from_numpy(unseen.category)


def save_head(model: MapHead, path: Path) -> None:
    """Write the weights; :func:`load_head` reads them."""
    data = io.BytesIO()
    torch.save(
        {"categories": json.dumps(model.categories), "wide": model.wide, "state": model.state_dict()}, data
    )
    write_atomic(path, data.getvalue())


def load_head(path: Path) -> MapHead:
    """What :func:`save_head` wrote.

    Raises:
        InputError: the file holds something else.
    """
    try:
        told = torch.load(path, map_location="cpu", weights_only=True)
        model = MapHead(json.loads(told["categories"]), bool(told.get("wide", False)))
        model.load_state_dict(told["state"])
    except Exception as error:  # a damaged archive raises nearly anything
        raise InputError(f"{path} holds no head ({error})") from error
    return model.eval()
