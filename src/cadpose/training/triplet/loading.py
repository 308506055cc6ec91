"""Weights that the encoders start from."""

from __future__ import annotations

import logging
from pathlib import Path

from cadpose import weights
from cadpose.training.checkpoints import read_checkpoint, set_weights, tensors
from cadpose.training.triplet.network import TwoEncoders

log = logging.getLogger(__name__)

#: Name of VGG16's ImageNet weights in :data:`cadpose.weights.REGISTRY`.
IMAGENET = "vgg16-imagenet"


def load_initial(network: TwoEncoders, init: str) -> None:
    """Set weights to start from, in place.

    Args:
        network: As it was made, its weights random.
        init: ``"random"``; ``"imagenet"``, fetched once; or a path: VGG16's weights in torchvision's names,
            alone or under ``state_dict``, for both encoders, or a checkpoint of this training. What belongs
            to a classifier is left out.

    Raises:
        DependencyError: the ImageNet weights are not there and cannot be fetched.
        InputError: a file cannot be read or does not fit.
    """
    if init == "random":
        return
    if init == "imagenet":
        entry = weights.REGISTRY[IMAGENET]
        if weights.location(entry) is None:
            log.warning("fetching %s, %.0f MB, once", entry.url, entry.size / 2**20)
        path = weights.ensure(IMAGENET)
    else:
        path = Path(init)
    content = read_checkpoint(path)
    if "photo" in content and "render" in content:
        set_weights(network.photo, tensors(content["photo"], str(path)), str(path))
        set_weights(network.render, tensors(content["render"], str(path)), str(path))
        return
    found = tensors(content.get("state_dict", content), str(path))
    for encoder in (network.photo, network.render):
        set_weights(encoder, found, str(path))
