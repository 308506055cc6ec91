"""Weights of others: MoCo v2's encoder to start from, and the authors' trained networks.

Nobody has published a SHA-256 of these files, so cadpose fetches none of them by itself. You put the
file in place, MoCo's is checked against the MD5 that is published, its SHA-256 is written beside it on
first use, and a file that changes afterwards is refused. Tensors are read without unpickling objects.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from torch import Tensor

from cadpose.training.checkpoints import read_checkpoint, set_weights, tensors
from cadpose.training.posecontrast.network import PoseContrast
from cadpose.weights import Unpublished, placed

#: What precedes the encoder's names in MoCo's checkpoints.
MOCO_PREFIX = "module.encoder_q."


#: What ``--init`` asks for by name.
CHECKPOINTS: dict[str, Unpublished] = {
    c.name: c
    for c in (
        Unpublished(
            name="moco",
            file="moco_v2_800ep_pretrain.pth.tar",
            url="https://dl.fbaipublicfiles.com/moco/moco_checkpoints/moco_v2_800ep/moco_v2_800ep_pretrain.pth.tar",
            # The repository's when the file was published; that its code is MIT by now tells nothing of it.
            licence="CC-BY-NC-4.0",
            # The README of facebookresearch/moco tells the first eight digits.
            md5="a04e12f8b0e44fdcac1fb4e06f33727b",
        ),
        Unpublished(
            name="posecontrast-pascal3d",
            file="posecontrast-pascal3d.pth",
            url="https://www.dropbox.com/s/mlmubnz9xgbflm4/ckpt.pth",
            licence="unknown",
        ),
        Unpublished(
            name="posecontrast-objectnet3d",
            file="posecontrast-objectnet3d.pth",
            url="https://github.com/YoungXIAO13/PoseContrast (the link in its README)",
            licence="unknown",
        ),
    )
}


def checkpoint_file(name: str) -> Path:
    """The path of a named checkpoint, checked as far as it can be.

    Raises:
        DependencyError: it is not there, is not the published file, or has changed since its first use.
        KeyError: no checkpoint has that name.
    """
    return placed(CHECKPOINTS[name])


def load_initial(network: PoseContrast, init: str) -> Literal["random", "encoder", "network"]:
    """Set weights to start from, in place.

    Args:
        network: As it was made, its weights random.
        init: ``"random"``, a key of :data:`CHECKPOINTS`, or a path.

    Returns:
        What was set: nothing, the encoder only, or all.

    Raises:
        DependencyError: a named checkpoint is not there or not the right file.
        InputError: a file cannot be read or does not fit.
    """
    if init == "random":
        return "random"
    path = checkpoint_file(init) if init in CHECKPOINTS else Path(init)
    return load_weights(network, read_checkpoint(path), str(path))


def load_weights(
    network: PoseContrast, content: Mapping[str, Any], name: str
) -> Literal["encoder", "network"]:
    """Set weights from a checkpoint's content, in place.

    Understood are the authors' checkpoints and cadpose's own (``net_feat`` and ``net_vp``), MoCo v2's
    (``state_dict`` with ``module.encoder_q.*``), the authors' converted form of it (``model``), and plain
    ResNet-50 weights. Last layers ``fc`` of encoders are left out.

    Returns:
        ``"network"`` when heads came too, else ``"encoder"``.

    Raises:
        InputError: a parameter is missing, of another shape, or not finite.
    """
    if "net_feat" in content and "net_vp" in content:
        encoder, head = tensors(content["net_feat"], name), tensors(content["net_vp"], name)
        set_weights(network.net_feat, _without_last(encoder), name)
        set_weights(network.net_vp, head, name)
        return "network"
    weights = tensors(content.get("state_dict", content.get("model", content)), name)
    if any(key.startswith(MOCO_PREFIX) for key in weights):
        weights = {k.removeprefix(MOCO_PREFIX): v for k, v in weights.items() if k.startswith(MOCO_PREFIX)}
    set_weights(network.net_feat, _without_last(weights), name)
    return "encoder"


def _without_last(weights: dict[str, Tensor]) -> dict[str, Tensor]:
    return {k: v for k, v in weights.items() if not k.startswith("fc.")}
