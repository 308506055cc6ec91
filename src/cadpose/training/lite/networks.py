"""The embedded networks as they are trained, side by side on the same crops.

Two tell rotations, a fine-tuned one and a head on the frozen encoder: together they are right more often than
either, because what one unlearns of real photos the other keeps. The third embeds views. None touches the
weights of another.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.training.lite.augment import NOTHING, crops
from cadpose.training.lite.embedder import Embedder, first_share
from cadpose.training.lite.frozen import FrozenEncoder
from cadpose.training.lite.head import MapHead
from cadpose.training.lite.network import LitePose, normalised
from cadpose.training.lite.objective import Targets
from cadpose.training.lite.stream import Objects
from cadpose.training.lite.validate import decoded, modulo

#: Logits, offsets and features.
Answer = tuple[list[Tensor], list[Tensor], Tensor]

#: The head learns with this weight decay, whatever the other member's.
_HEAD_DECAY = 0.05


class EmbeddedNetworks(nn.Module):
    """All of them.

    Args:
        categories: Names in the order of the category input.
        backbone: Of the fine-tuned member.
        pretrained: Begin with ImageNet weights.

    Raises:
        DependencyError: the packages of the backbone are not installed.
    """

    def __init__(self, categories: Sequence[str], backbone: str = "lite0", pretrained: bool = True) -> None:
        super().__init__()
        self.tuned = LitePose(categories, backbone, pretrained)
        self.head = MapHead(categories, wide=True)
        self.embedder = Embedder(pretrained)

    @property
    def categories(self) -> tuple[str, ...]:
        """Names in the order of the category input."""
        return self.tuned.categories

    def forward(self, images: Tensor, cells: Sequence[Tensor], category: Tensor) -> tuple[Answer, Answer]:
        """What the two that tell rotations say.

        Args:
            images: (N, 3, 224, 224) RGB, (x - 127) / 128.
            cells: The same as the frozen encoder sees them, see :class:`FrozenEncoder`.
            category: (N, C) one-hot; zeros for an unknown category.
        """
        return self.tuned(images, category), self.head(cells[0], cells[1], category)

    def parameter_groups(self, rate: float, backbone_share: float) -> list[dict[str, object]]:
        """Parameters for an optimiser, the backbone's first."""
        head = {"params": list(self.head.parameters()), "lr": rate, "weight_decay": _HEAD_DECAY}
        return [
            *self.tuned.parameter_groups(rate, backbone_share),
            head,
            *self.embedder.parameter_groups(rate, backbone_share),
        ]


@torch.no_grad()
def rotation_errors(
    networks: EmbeddedNetworks, encoder: FrozenEncoder, chunks: Sequence[Objects], device: torch.device
) -> tuple[dict[str, Tensor], Tensor]:
    """(M,) errors in degrees modulo symmetry about the upright axis of ``tuned``, ``head`` and ``both``.

    Args:
        networks: All of them.
        encoder: What the head sees through.
        chunks: Objects to measure on.
        device: Where all of them are.

    Returns:
        The errors, and (M,) category numbers.
    """
    was_training = networks.training
    networks.eval()
    found: dict[str, list[Tensor]] = {"tuned": [], "head": [], "both": []}
    categories: list[Tensor] = []
    generator = torch.Generator(device).manual_seed(0)
    for chunk in chunks:
        photos, boxes, visible, angles, turns, category = (t.to(device) for t in chunk.fields()[:6])
        targets = Targets(angles, turns)
        images = normalised(crops(photos, boxes, visible, targets, NOTHING, generator)[0])
        one_hot = functional.one_hot(category, len(networks.categories)).float()
        answers = networks(images, encoder(images), one_hot)
        told = {"tuned": answers[0][:2], "head": answers[1][:2], "both": averaged(answers)}
        for name, (logits, offsets) in told.items():
            found[name].append(modulo(decoded(logits, offsets), targets).cpu())
        categories.append(category.cpu())
    networks.train(was_training)
    return {name: torch.cat(some) for name, some in found.items()}, torch.cat(categories)


def averaged(answers: Sequence[Answer]) -> tuple[list[Tensor], list[Tensor]]:
    """Log of the members' mean probabilities and their offsets, as ``rotation.network`` averages them."""
    logs, offsets = [], []
    for i in range(3):
        shares = torch.stack([answer[0][i].float().softmax(dim=1) for answer in answers])
        told = torch.stack([answer[1][i].float() for answer in answers])
        mean = shares.mean(dim=0).clamp(min=1e-12)
        logs.append(mean.log())
        offsets.append((shares * told).mean(dim=0) / mean)
    return logs, offsets


def shrunk(images: Tensor) -> Tensor:
    """(N, 3, 224, 224) crops to the (N, 3, 112, 112) that the embedder takes."""
    return functional.avg_pool2d(images, 2)


@torch.no_grad()
def embedding_share(networks: EmbeddedNetworks, chunks: Sequence[Objects], device: torch.device) -> float:
    """Share of photos for which the embedder finds the model among all of the category; see `first_share`."""
    was_training = networks.training
    networks.eval()
    rows: list[tuple[Tensor, ...]] = []
    generator = torch.Generator(device).manual_seed(0)
    for chunk in chunks:
        photos, boxes, visible, angles, turns, category, renders, models = (
            t.to(device) for t in chunk.fields()
        )
        images, _ = crops(photos, boxes, visible, Targets(angles, turns), NOTHING, generator)
        seen = networks.embedder(shrunk(normalised(images)))
        rows.append((seen, networks.embedder(normalised(renders.float())), models, category))
    networks.train(was_training)
    photos, renders, models, category = (torch.cat(part) for part in zip(*rows, strict=True))
    return first_share(photos, renders, models, category)
