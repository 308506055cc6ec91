"""An embedding of views for whole libraries: a photo lies near the plain renders of its CAD model.

Photo and render go through the same small network. A render shows the model as the library has it, turned
nearly as in the photo; in the photo its proportions and colours may be others. Negatives are all other models
of the batch and of the batches before it, many of the same category.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from cadpose.training.lite.network import imagenet_network

#: Side of what is embedded, and numbers of an embedding.
SIDE, WIDTH = 112, 128
#: Blocks of Lite0 up to its stride-16 map.
_TRUNK, _CHANNELS = 11, 112
_TEMPERATURE = 0.06
#: Batches whose renders serve as further negatives.
_KEPT = 12


class Embedder(nn.Module):
    """RGB squares to unit vectors. Where things are is kept: two models differ by proportions and parts.

    Args:
        pretrained: Begin with ImageNet weights.

    Raises:
        DependencyError: the packages of the backbone are not installed.
    """

    def __init__(self, pretrained: bool = True) -> None:
        super().__init__()
        net = imagenet_network("lite0", pretrained)
        self.stem = nn.Sequential(net._conv_stem, net._bn0, nn.ReLU6())
        self.blocks = nn.Sequential(*list(net._blocks)[:_TRUNK])
        self.shape = nn.Sequential(
            nn.Conv2d(_CHANNELS, 192, 3, padding=1, bias=False), nn.BatchNorm2d(192), nn.ReLU(),
            nn.Conv2d(192, 256, 3, stride=2, padding=1, bias=False), nn.BatchNorm2d(256), nn.ReLU(),
        )  # fmt: skip
        self.project = nn.Linear(256 * 16, WIDTH)

    def forward(self, images: Tensor) -> Tensor:
        """(N, 3, 112, 112) RGB, (x - 127) / 128, to (N, 128) of unit length."""
        x = self.shape(self.blocks(self.stem(images)))
        return functional.normalize(self.project(x.flatten(1)).float(), dim=1)

    def parameter_groups(self, rate: float, backbone_share: float) -> list[dict[str, object]]:
        """Parameters for an optimiser: those of the backbone learn more slowly than the new ones."""
        old = [p for module in (self.stem, self.blocks) for p in module.parameters()]
        new = [p for module in (self.shape, self.project) for p in module.parameters()]
        return [{"params": old, "lr": rate * backbone_share}, {"params": new, "lr": rate}]


class RenderQueue:
    """Embeddings of the renders of the last batches, further negatives."""

    def __init__(self) -> None:
        self._kept: list[tuple[Tensor, Tensor]] = []

    def add(self, renders: Tensor, models: Tensor) -> None:
        """Keep a batch, forget the oldest."""
        self._kept = [*self._kept, (renders.detach(), models)][-_KEPT:]

    def with_kept(self, renders: Tensor, models: Tensor) -> tuple[Tensor, Tensor]:
        """A batch and after it all that is kept."""
        return (
            torch.cat([renders, *(r for r, _ in self._kept)]),
            torch.cat([models, *(m for _, m in self._kept)]),
        )


def matching_loss(photos: Tensor, renders: Tensor, models: Tensor, queue: RenderQueue) -> Tensor:
    """InfoNCE both ways between (N, D) photos and (N, D) renders of the same N models.

    Other rows of the same model are neither right nor wrong: they show it from elsewhere.
    """
    keys, of = queue.with_kept(renders, models)
    n, row = len(photos), torch.arange(len(photos), device=photos.device)
    there = photos @ keys.T / _TEMPERATURE
    back = renders @ photos.T / _TEMPERATURE
    same = models[:, None] == of[None]
    same[row, row] = False
    there = there.masked_fill(same, -torch.inf)
    back = back.masked_fill(same[:, :n], -torch.inf)
    queue.add(renders, models)
    return (functional.cross_entropy(there, row) + functional.cross_entropy(back, row)) / 2.0


@torch.no_grad()
def first_share(photos: Tensor, renders: Tensor, models: Tensor, category: Tensor) -> float:
    """Share of photos whose own model is the nearest of its category, by the best render of each model."""
    likeness = photos @ renders.T
    likeness = likeness.masked_fill(category[:, None] != category[None], -2.0)
    return float((models[likeness.argmax(dim=1)] == models).float().mean())
