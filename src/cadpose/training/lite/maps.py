"""What the frozen encoder sees of synthetic objects, drawn once and kept: shards of described crops.

Training a head on maps that are kept is a hundred times cheaper than training through the encoder, and what
the encoder learnt from real photos is not unlearnt.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from cadpose.encoder import lite0
from cadpose.errors import CadposeError, InputError
from cadpose.library.storage import write_atomic
from cadpose.rotation.features import LEVELS, describe
from cadpose.training.lite.augment import Augmentation, crops
from cadpose.training.lite.objective import Targets
from cadpose.training.lite.stream import Source, objects
from cadpose.training.synth.generator import SynthGenerator

#: Photos a shard.
SHARD = 96
_DAMAGE = (OSError, EOFError, TypeError, ValueError, KeyError, BadZipFile)


@dataclass(frozen=True, eq=False)
class Maps:
    """M described crops.

    Attributes:
        cells: One int8 array a level of ``rotation.features.LEVELS``, (M, cells, channels).
        angles: (M, 3) float32 azimuth, elevation, in-plane rotation.
        turns: (M,) int64 number of azimuths that look the same, 0 for a body of revolution.
        category: (M,) int64.
    """

    cells: tuple[NDArray[np.int8], ...]
    angles: NDArray[np.float32]
    turns: NDArray[np.int64]
    category: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.turns)

    def to_bytes(self) -> bytes:
        """The form kept on disk."""
        out = io.BytesIO()
        named = {f"cells{i}": c for i, c in enumerate(self.cells)}
        np.savez(
            out, allow_pickle=False, **named, angles=self.angles, turns=self.turns, category=self.category
        )
        return out.getvalue()

    @classmethod
    def from_file(cls, path: Path) -> Maps:
        """What :meth:`to_bytes` wrote.

        Raises:
            InputError: the file holds something else.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                cells = tuple(data[f"cells{i}"] for i in range(len(LEVELS)))
                return cls(cells, data["angles"], data["turns"], data["category"])
        except _DAMAGE as error:
            raise InputError(f"{path} is no shard of described crops ({error}): delete it") from error

    @classmethod
    def from_files(cls, paths: Sequence[Path]) -> tuple[Maps, list[int]]:
        """All crops of several files in order, and how many each holds; never twice in memory.

        Raises:
            InputError: a file holds something else.
        """
        sizes = [_count(path) for path in paths]
        n = sum(sizes)
        whole = cls(
            tuple(np.empty((n, level.cells, level.channels), np.int8) for level in LEVELS),
            np.empty((n, 3), np.float32),
            np.empty(n, np.int64),
            np.empty(n, np.int64),
        )
        at = 0
        for path, size in zip(paths, sizes, strict=True):
            part, rows = cls.from_file(path), slice(at, at + size)
            for cells, new in zip(whole.cells, part.cells, strict=True):
                cells[rows] = new
            whole.angles[rows], whole.turns[rows] = part.angles, part.turns
            whole.category[rows] = part.category
            at += size
        return whole, sizes

    @classmethod
    def empty(cls) -> Maps:
        """No crops."""
        cells = tuple(np.empty((0, level.cells, level.channels), np.int8) for level in LEVELS)
        return cls(cells, np.empty((0, 3), np.float32), np.empty(0, np.int64), np.empty(0, np.int64))

    @classmethod
    def joined(cls, parts: Sequence[Maps]) -> Maps:
        """All crops in order."""
        return cls(
            tuple(np.concatenate([p.cells[i] for p in parts]) for i in range(len(LEVELS))),
            np.concatenate([p.angles for p in parts]),
            np.concatenate([p.turns for p in parts]),
            np.concatenate([p.category for p in parts]),
        )


def _count(path: Path) -> int:
    try:
        with np.load(path, allow_pickle=False) as data:  # only what is asked for is read
            return len(data["turns"])
    except _DAMAGE as error:
        raise InputError(f"{path} is no shard of described crops ({error}): delete it") from error


def draw_shards(
    source: Source,
    folder: Path,
    shards: Sequence[int],
    *,
    augmentations: Sequence[Augmentation],
    main_only: bool = False,
    workers: int = 2,
    on_done: Callable[[Path], None] = lambda _: None,
) -> Iterator[Path]:
    """Draw those shards that are not there yet; yields the path of each.

    A shard depends on the source, its number and the options alone, so a killed run goes on where it was.

    Args:
        source: What photos are drawn from.
        folder: Where the shards lie.
        shards: Their numbers.
        augmentations: Every object is cut out once with each.
        main_only: Leave out the objects beside the main one.
        workers: Processes.
        on_done: Called with every shard that was drawn.

    Raises:
        CadposeError: a drawing process was killed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    todo = [(k, folder / f"{k:06d}.npz") for k in shards]
    missing = [(k, path) for k, path in todo if not path.is_file()]
    yield from (path for k, path in todo if path.is_file())
    # Forked workers share what the parent has loaded; one core each.
    cv2.setNumThreads(1)
    pool = ProcessPoolExecutor(max(1, workers), initializer=_one_thread)
    try:
        jobs = [pool.submit(_draw, source, k, path, tuple(augmentations), main_only) for k, path in missing]
        for job in jobs:
            path = job.result()
            on_done(path)
            yield path
    except BrokenProcessPool as error:
        raise CadposeError(
            "a process that draws photos was killed, perhaps for want of memory: go on with fewer workers"
        ) from error
    finally:
        # Who stops listening does not wait for a thousand shards.
        pool.shutdown(cancel_futures=True)


def _one_thread() -> None:
    torch.set_num_threads(1)
    cv2.setNumThreads(1)


#: The process's generator and what it draws from.
_KEPT: list[tuple[Source, SynthGenerator]] = []


def _generator(source: Source) -> SynthGenerator:
    if not _KEPT or _KEPT[0][0] != source:
        _KEPT[:] = [(source, source.generator())]
    return _KEPT[0][1]


def _draw(
    source: Source, shard: int, path: Path, augmentations: tuple[Augmentation, ...], main_only: bool
) -> Path:
    generator = _generator(source)
    found = objects(generator, range(shard * SHARD, (shard + 1) * SHARD), source, main_only, plain=False)
    if found is None:
        write_atomic(path, Maps.empty().to_bytes())
        return path
    seeded = torch.Generator().manual_seed(source.seed * 1_000_003 + shard)
    parts = []
    for augmentation in augmentations:
        targets = Targets(found.angles, found.turns)
        images, changed = crops(found.photos, found.boxes, found.visible_boxes, targets, augmentation, seeded)
        pixels = np.ascontiguousarray(images.round().to(torch.uint8).permute(0, 2, 3, 1).numpy())
        described = describe(lite0("cpu", 1), pixels)
        parts.append(
            Maps(described.cells, changed.angles.numpy(), changed.turns.numpy(), found.category.numpy())
        )
    write_atomic(path, Maps.joined(parts).to_bytes())
    return path
