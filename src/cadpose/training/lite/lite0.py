"""The embedded network: EfficientNet-Lite0 fine-tuned end to end, and a head on the frozen one beside it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.devices import torch_device
from cadpose.training.lite.curves import Curves, Row, unseen_rows
from cadpose.training.lite.folder import begin
from cadpose.training.lite.sources import UNSEEN_PHOTOS, sources
from cadpose.training.lite.train import CHECKPOINT, Recipe, plain, trained_networks
from cadpose.training.lite.train import train as fine_tune

#: Objects kept for learning: an object takes 0.23 MB, and a GPU has memory to spare.
_BUFFER = {"cuda": 120_000, "cpu": 8_000}
_MEASURED = ("acc30", "acc10", "mederr", "macro30")


def train(
    options: TrainingOptions,
    on_step: OnStep,
    *,
    backbone: str = "lite0",
    unseen_photos: int = UNSEEN_PHOTOS,
    **recipe: Any,
) -> TrainingReport:
    """Train by the options; checkpoint and curves are written as it goes.

    Args:
        options: ``library``, ``backgrounds``, ``steps`` and ``batch_size`` are used besides the common ones.
        on_step: Called now and then.
        backbone: One of :data:`cadpose.training.lite.network.BACKBONES`.
        unseen_photos: Photos of held-out models to measure on.
        **recipe: Other numbers of :class:`cadpose.training.lite.train.Recipe`.

    Raises:
        InputError: the library has nothing to learn from, or the folder holds another training.
        DependencyError: the device or the backbone's packages are not there.
    """
    torch_device(options.device)
    told = {"workers": options.workers or os.cpu_count() or 1, "buffer": _BUFFER[options.device]}
    numbers = {"steps": options.steps, "batch": options.batch_size}
    chosen = {k: v for k, v in numbers.items() if v is not None}
    how = Recipe(seed=options.seed, **{**told, **chosen, **recipe})
    drawn = sources(Library.open(options.library), options.backgrounds, options.seed)
    settings = {"architecture": backbone, **drawn.to_json(), "recipe": plain(how)}
    begin(options.out, settings, options.resume)
    fine_tune(
        drawn.train,
        how,
        options.out,
        validation=drawn.unseen,
        validation_photos=unseen_photos,
        backbone=backbone,
        device=options.device,
        resume=options.resume,
        on_step=lambda step, _row: on_step(step, how.steps),
    )
    curves = Curves(options.out)
    curves.draw()
    checkpoint = options.out / CHECKPOINT
    rows, last = told_of(curves.rows)
    return TrainingReport(checkpoint, checkpoint, curves.path, rows, last, None)


def export(weights: str, path: Path, heads: Sequence[Path] = (), embedding: Path | None = None) -> None:
    """Write all members of the embedded network as one ONNX file, compared with torch's answers.

    Args:
        weights: Checkpoint.
        path: ONNX file to write.
        heads: ``head.pt`` of trainings of ``lite0-head``, further members.
        embedding: ONNX file to write the embedder to, None to leave it out.

    Raises:
        InputError: a file is missing, or the members know different categories.
        CadposeError: a file holds something else.
        DependencyError: a package is not installed.
    """
    from cadpose.training.lite.export import export as export_all
    from cadpose.training.lite.export import export_embedder
    from cadpose.training.lite.head import load_head

    for file in (Path(weights), *heads):
        if not file.is_file():
            raise InputError(f"there is no file {file}")
    networks, others = trained_networks(Path(weights)), [load_head(head) for head in heads]
    for head, other in zip(heads, others, strict=True):
        if networks.categories != other.categories:
            raise InputError(f"{weights} and {head} were trained on different categories")
    export_all(networks.tuned, [networks.head, *others], path)
    if embedding is not None:
        export_embedder(networks.embedder, embedding)


def told_of(rows: list[Row]) -> tuple[list[Row], dict[str, Any] | None]:
    """What a report tells: the looks at unseen models, else the last row; and the last look by class."""
    unseen = unseen_rows(rows)
    if not unseen:
        return rows[-1:], None
    last = unseen[-1]
    classes = {k.partition("/")[2]: {"acc30": v} for k, v in last.items() if k.startswith("acc30/")}
    return (
        [{"step": row["step"], **{k: row[k] for k in _MEASURED}} for row in unseen],
        {**{k: last[k] for k in _MEASURED}, "classes": classes},
    )
