"""Train the box-to-mask network on synthetic photos, whose masks are exact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.library.catalogue import Library
from cadpose.training import drawn as drawing
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.devices import keep_memory, torch_device
from cadpose.training.drawn import DrawnStream, recipe_numbers, train_drawn
from cadpose.training.lite.augment import NOTHING, Augmentation
from cadpose.training.lite.sources import Sources, sources
from cadpose.training.masks.crops import Crops, crops
from cadpose.training.masks.export import export
from cadpose.training.masks.network import MaskNetwork
from cadpose.training.masks.stream import MaskedObjects, masked_objects

#: Flaws of photos and of detectors' boxes.
FLAWS = Augmentation(jitter=0.1, colour=0.3, small=0.2, blur=0.2, noise=0.2, erase=0.0)
#: Boxes of unseen objects are off by this share of their sides, as a detector's.
UNSEEN_JITTER = 0.05
UNSEEN_PHOTOS = 192


@dataclass(frozen=True)
class Recipe(drawing.Recipe):
    """As the shipped network was trained, unless told; one object takes 0.33 MB of memory.

    Attributes:
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
    recipe = Recipe(**recipe_numbers(options, numbers))
    drawn = mask_sources(Library.open(options.library), options.backgrounds, options.seed)
    torch.manual_seed(recipe.seed)
    return train_drawn(_Lesson(drawn, recipe.flaws, where), recipe, drawn, options, on_step, where)


class _Lesson:
    """A :class:`cadpose.training.drawn.Lesson`."""

    name, part = "masks", "decoder"
    examples = staticmethod(masked_objects)

    def __init__(self, drawn: Sources, flaws: Augmentation, where: torch.device) -> None:
        self.flaws, self.where = flaws, where
        # Depthwise convolutions of this layout take half the time on a CPU.
        model = MaskNetwork().to(where, memory_format=torch.channels_last)  # type: ignore[call-overload]
        self.network: nn.Module = model
        self.trained: nn.Module = model.decoder
        self._taps = model.taps
        self._unseen = _unseen(drawn)

    def lost(self, drawn: MaskedObjects, generator: torch.Generator) -> tuple[Tensor, dict[str, Tensor]]:
        seen = crops(drawn, self.flaws, generator)
        logits, quality = self.network(seen.images.contiguous(memory_format=torch.channels_last), seen.boxes)
        lost, true = mask_loss(logits, seen.masks), ious(logits.detach(), seen.masks)
        told = functional.binary_cross_entropy_with_logits(quality, true)
        return lost + 0.1 * told, {"loss": lost.detach(), "quality": told.detach(), "iou": true.mean()}

    @torch.no_grad()
    def measured(self, average: nn.Module) -> dict[str, float]:
        found = []
        for seen in self._unseen:
            images = seen.images.to(self.where, memory_format=torch.channels_last)
            maps = self._taps((images - 127.0) / 128.0)
            logits, _ = cast(Any, average)(maps, seen.boxes.to(self.where))
            found.append(ious(logits, seen.masks.to(self.where)))
        if not found:
            return {}
        every = torch.cat(found)
        return {
            "iou": float(every.mean()),
            "median": float(every.median()),
            "over90": float((every >= 0.9).float().mean()),
        }

    def export(self, checkpoint: Path, network: Path) -> None:
        export(checkpoint, network)


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


def _unseen(drawn: Sources) -> list[Crops]:
    if drawn.unseen is None:
        return []
    flaws, generator = replace(NOTHING, jitter=UNSEEN_JITTER), torch.Generator().manual_seed(0)
    chunks = DrawnStream(drawn.unseen, masked_objects, photos=UNSEEN_PHOTOS)
    return [crops(chunk, flaws, generator) for chunk in chunks]
