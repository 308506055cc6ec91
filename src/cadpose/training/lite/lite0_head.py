"""Stage two of the embedded network: a head on what the frozen encoder sees of synthetic photos."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.training.architectures import OnStep, TrainingOptions, TrainingReport
from cadpose.training.devices import torch_device
from cadpose.training.lite.augment import GENTLE, NOTHING, Augmentation
from cadpose.training.lite.curves import Curves, Row
from cadpose.training.lite.folder import begin
from cadpose.training.lite.head import CHECKPOINT, HeadRecipe, save_head, train_head
from cadpose.training.lite.lite0 import told_of
from cadpose.training.lite.maps import SHARD, Maps, draw_shards
from cadpose.training.lite.sources import UNSEEN_PHOTOS, sources

HEAD = "head.pt"
#: Photos to learn from; each gives two crops of every object in it.
PHOTOS = 506 * SHARD
#: Unseen objects are cut out as a detector's box would, a little off.
_UNSEEN = replace(NOTHING, jitter=0.03)


def train(
    options: TrainingOptions,
    on_step: OnStep,
    *,
    unseen_photos: int | None = None,
    **recipe: Any,
) -> TrainingReport:
    """Draw the maps that are not there yet, then fit the head.

    Args:
        options: ``library``, ``backgrounds``, ``photos``, ``epochs`` and ``batch_size`` are used besides the
            common ones.
        on_step: Called after every shard of 96 photos, then while the head is fitted, with the parts of the
            whole that are done.
        unseen_photos: Photos of held-out models to measure on, ``UNSEEN_PHOTOS`` unless told.
        **recipe: Other numbers of :class:`cadpose.training.lite.head.HeadRecipe`.

    Raises:
        InputError: the library has nothing to learn from, or the folder holds another training.
        DependencyError: the device is not there.
        CadposeError: a drawing process was killed.
    """
    torch_device(options.device)
    numbers = {"epochs": options.epochs, "batch": options.batch_size}
    how = HeadRecipe(seed=options.seed, **{**{k: v for k, v in numbers.items() if v is not None}, **recipe})
    drawn = sources(Library.open(options.library), options.backgrounds, options.seed)
    shards = _shards(options.photos or PHOTOS)
    unseen_shards = _shards(unseen_photos or UNSEEN_PHOTOS) if drawn.unseen else range(0)
    settings = {
        "architecture": "lite0-head",
        **drawn.to_json(),
        "photos": len(shards) * SHARD,
        "unseen_photos": len(unseen_shards) * SHARD,
        "recipe": asdict(how),
    }
    begin(options.out, settings, options.resume)
    workers = options.workers or os.cpu_count() or 1
    whole = len(unseen_shards) + len(shards)
    done = _counter(lambda n: on_step(n, 2 * whole))
    unseen: Maps | None = None
    if drawn.unseen is not None:
        files = draw_shards(
            drawn.unseen,
            options.out / "maps" / "unseen",
            unseen_shards,
            augmentations=[_UNSEEN],
            main_only=True,
            workers=workers,
        )
        unseen, _ = Maps.from_files(sorted(map(done, files)))
    files = draw_shards(
        drawn.train,
        options.out / "maps" / "train",
        shards,
        augmentations=[GENTLE, Augmentation()],
        workers=workers,
    )
    kept = sorted(map(done, files))

    def fitted(step: int, row: Row) -> None:
        if "steps" in row:
            on_step(whole + round(whole * step / row["steps"]), 2 * whole)

    head = train_head(
        kept,
        drawn.train.categories,
        how,
        unseen=unseen,
        device=options.device,
        out=options.out,
        resume=options.resume,
        on_step=fitted,
    )
    network = options.out / HEAD
    save_head(head, network)
    curves = Curves(options.out)
    curves.draw()
    rows, last = told_of(curves.rows)
    return TrainingReport(network, options.out / CHECKPOINT, curves.path, rows, last, None)


def export(weights: str, path: Path, heads: Sequence[Path] = (), embedding: Path | None = None) -> None:
    """Refused: all members are exported together, by the architecture ``lite0``.

    Raises:
        InputError: always; it tells how.
    """
    raise InputError(
        "a head is exported with the network that it is a further member of: "
        f"cadpose train export CHECKPOINT --arch lite0 --head {weights} --out {path}"
    )


def _shards(photos: int) -> range:
    return range(-(-photos // SHARD))


def _counter(told: Callable[[int], None]) -> Callable[[Path], Path]:
    """Passes paths on and counts them."""
    count = 0

    def one_more(path: Path) -> Path:
        nonlocal count
        count += 1
        told(count)
        return path

    return one_more
