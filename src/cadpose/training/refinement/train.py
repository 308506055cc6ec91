"""Train the refinement network on pairs of synthetic photos and drawn models."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.library.catalogue import Library
from cadpose.rotation.features import STEPS
from cadpose.training import drawn as drawing
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.devices import keep_memory, torch_device
from cadpose.training.drawn import DrawnStream, recipe_numbers, train_drawn
from cadpose.training.lite.sources import Sources, sources
from cadpose.training.lite.stream import Source
from cadpose.training.refinement.export import export
from cadpose.training.refinement.network import CELLS, UNITS, StepNetwork
from cadpose.training.refinement.pairs import PairMaker, Pairs
from cadpose.training.synth.generator import SynthGenerator

UNSEEN_PHOTOS = 480
#: Noise on the photo's standardised map, of each value and of each channel as a whole: other cameras.
NOISE = 0.15
#: Weight of the loss of the error that the network expects, and the most that one number of a step counts.
_ERROR_WEIGHT, _MOST_LOSS = 0.05, 6.0


@dataclass(frozen=True)
class Recipe(drawing.Recipe):
    """As the shipped network was trained, unless told; one pair takes 44 kB of memory."""

    steps: int = 10_000
    batch: int = 64
    fresh: int = 7
    buffer: int = 60_000
    rate: float = 2e-3
    decay: float = 0.02
    warmup: int = 200
    ema: float = 0.998


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
    recipe = Recipe(**recipe_numbers(options, numbers))
    drawn = pair_sources(Library.open(options.library), options.backgrounds, options.seed)
    torch.manual_seed(recipe.seed)
    return train_drawn(_Lesson(drawn, where), recipe, drawn, options, on_step, where)


class _Lesson:
    """A :class:`cadpose.training.drawn.Lesson`."""

    name, part = "refinement", "network"

    def __init__(self, drawn: Sources, where: torch.device) -> None:
        self.where, self._pairs = where, PairMaker()
        self.network: nn.Module = StepNetwork().to(where)
        self.trained: nn.Module = self.network
        self._unseen: list[Pairs] = []
        if drawn.unseen is not None:
            # A maker of its own: what ONNX Runtime has opened does not outlive the fork of the workers.
            self._unseen += DrawnStream(drawn.unseen, PairMaker(), photos=UNSEEN_PHOTOS)

    def examples(self, generator: SynthGenerator, numbers: Sequence[int]) -> Pairs | None:
        return self._pairs(generator, numbers)

    def lost(self, drawn: Pairs, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        photo, view, cover = seen(drawn, self.where)
        for shape in (photo.shape, (*photo.shape[:2], 1, 1)):
            photo = photo + NOISE * torch.randn(shape, generator=generator, device=self.where)
        true = drawn.step / torch.tensor(UNITS, device=self.where)
        told, expected = self.network(photo, view, cover)
        lost = functional.smooth_l1_loss(told, true, reduction="none", beta=0.3).clamp(max=_MOST_LOSS).mean()
        off = (told[:, :3] - true[:, :3]).detach().norm(dim=1)
        doubt = functional.l1_loss(torch.log(expected + 0.1), torch.log(off + 0.1))
        return lost + _ERROR_WEIGHT * doubt, {"loss": lost.detach(), "doubt": doubt.detach()}

    def measured(self, average: nn.Module) -> dict[str, float]:
        return measured(average, self._unseen, self.where) if self._unseen else {}

    def export(self, checkpoint: Path, network: Path) -> None:
        export(checkpoint, network)


def seen(pairs: Pairs, where: torch.device) -> tuple[Tensor, Tensor, Tensor]:
    """Maps and cover of pairs as the network takes them."""

    def maps(cells: Tensor) -> Tensor:
        values = cells.to(where, torch.float32) / STEPS
        return values.transpose(1, 2).reshape(len(cells), -1, CELLS, CELLS)

    cover = pairs.cover.to(where, torch.float32) / 255.0
    return maps(pairs.photo), maps(pairs.view), cover.reshape(-1, 1, CELLS, CELLS)


@torch.no_grad()
def measured(model: nn.Module, pairs: Sequence[Pairs], where: torch.device) -> dict[str, float]:
    """Angles in degrees before and after one step, of poses within 20°; medians and shares."""
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
