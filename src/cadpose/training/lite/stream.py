"""An endless stream of synthetic objects, drawn by worker processes in a fixed order."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch
from torch import Tensor
from torch.utils.data import DataLoader, IterableDataset, get_worker_info

from cadpose.geometry.angles import rotation_from_angles
from cadpose.library.catalogue import Library
from cadpose.training.lite.embedder import SIDE
from cadpose.training.lite.objective import MOST_TURNS
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.options import SynthOptions
from cadpose.training.synth.records import SynthObject

#: Photos that a worker draws at once, a whole number of series.
_CHUNK = 4
#: Objects of which less is seen, or that are smaller in pixels, are not learned from.
LEAST_VISIBLE, LEAST_SIDE = 0.5, 40.0
#: Beside the numbers that the generator seeds with.
_RENDERS = 2
_NO_RENDER = np.empty((3, 0, 0), np.uint8)


@dataclass(frozen=True)
class Source:
    """What photos are drawn from.

    Attributes:
        library: Folder of the CAD library.
        models: Ids of the models to draw.
        backdrops: Folder of photos, None for made-up backdrops.
        categories: Names in the order of the category numbers.
        options: Chances and ranges.
        seed: Of the photos.
    """

    library: Path
    models: tuple[str, ...]
    backdrops: Path | None
    categories: tuple[str, ...]
    options: SynthOptions
    seed: int

    def generator(self) -> SynthGenerator:
        """One generator, for one process."""
        library = Library.open(self.library)
        library.cache_size = len(self.models)
        return SynthGenerator(
            [library.get(i) for i in self.models],
            library.mesh,
            library.symmetry,
            Backdrops(self.backdrops),
            self.options,
            self.seed,
        )


@dataclass(frozen=True)
class Objects:
    """M objects, each with the photo that shows it.

    Attributes:
        photos: (M, 3, S, S) uint8.
        boxes: (M, 4) float32 rectangles of the whole objects.
        visible_boxes: (M, 4) float32 rectangles of what is seen.
        angles: (M, 3) float32 azimuth, elevation, in-plane rotation.
        turns: (M,) int64 number of azimuths that look the same, 0 for a body of revolution.
        category: (M,) int64.
        renders: (M, 3, 112, 112) uint8 plain views of the same models, turned nearly as in the photos.
        models: (M,) int64 numbers of the models in their source.
    """

    photos: Tensor
    boxes: Tensor
    visible_boxes: Tensor
    angles: Tensor
    turns: Tensor
    category: Tensor
    renders: Tensor
    models: Tensor

    def __len__(self) -> int:
        return len(self.turns)

    def fields(self) -> tuple[Tensor, ...]:
        """All tensors, in the order of the attributes."""
        return (
            self.photos, self.boxes, self.visible_boxes, self.angles, self.turns, self.category,
            self.renders, self.models,
        )  # fmt: skip

    def pin_memory(self) -> Objects:
        """The same in memory that a GPU copies from directly."""
        return Objects(*(t.pin_memory() for t in self.fields()))


class ObjectStream(IterableDataset[Objects]):
    """Chunks of objects from photo ``first`` on; worker w of W draws chunks w, w + W, ...

    Args:
        source: What is drawn from.
        first: Number of the first photo.
        photos: How many photos, None for no end.
        main_only: Leave out the objects beside the main one.
    """

    def __init__(
        self, source: Source, first: int = 0, photos: int | None = None, main_only: bool = False
    ) -> None:
        self.source = source
        self.first = first
        self.photos = photos
        self.main_only = main_only

    @property
    def chunk(self) -> int:
        """Photos a chunk."""
        return _CHUNK * self.source.options.series

    def __iter__(self) -> Iterator[Objects]:
        generator = self.source.generator()
        for numbers in worker_chunks(self.first, self.photos, self.chunk):
            found = objects(generator, numbers, self.source, self.main_only)
            if found is not None:
                yield found


def worker_chunks(first: int, photos: int | None, chunk: int) -> Iterator[range]:
    """Numbers of the photos that this worker draws, chunk by chunk: w, w + W, ... of W workers' chunks."""
    info = get_worker_info()
    worker, workers = (info.id, info.num_workers) if info else (0, 1)
    at, end = first + worker * chunk, None if photos is None else first + photos
    while end is None or at < end:
        yield range(at, at + chunk if end is None else min(at + chunk, end))
        at += workers * chunk


def objects(
    generator: SynthGenerator,
    indices: Sequence[int],
    source: Source,
    main_only: bool = False,
    plain: bool = True,
) -> Objects | None:
    """The objects of some photos that are worth learning from, None if there is none.

    Args:
        generator: Draws the photos.
        indices: Their numbers.
        source: What ``generator`` was made of.
        main_only: Leave out the objects beside the main one.
        plain: Draw the plain views too; without they are of no pixels.
    """
    number = {name: i for i, name in enumerate(source.categories)}
    model = {name: i for i, name in enumerate(source.models)}
    rows: list[tuple[np.ndarray, SynthObject]] = []
    renders = []
    for i in indices:
        photo = generator.photo(i)
        picture = np.ascontiguousarray(photo.rgb.transpose(2, 0, 1))
        worth = [o for o in photo.objects[: 1 if main_only else None] if _worth(o)]
        rows += [(picture, o) for o in worth]
        rng = np.random.default_rng((source.seed, _RENDERS, i))
        renders += [_render(generator, o, rng) if plain else _NO_RENDER for o in worth]
    if not rows:
        return None
    return Objects(
        photos=torch.from_numpy(np.stack([picture for picture, _ in rows])),
        boxes=torch.tensor([o.box.to_tuple() for _, o in rows], dtype=torch.float32),
        visible_boxes=torch.tensor([o.visible_box.to_tuple() for _, o in rows], dtype=torch.float32),
        angles=torch.tensor(
            [(o.rotation.azimuth, o.rotation.elevation, o.rotation.inplane) for _, o in rows],
            dtype=torch.float32,
        ),
        turns=torch.tensor([turns_of(o) for _, o in rows]),
        category=torch.tensor([number[o.category] for _, o in rows]),
        renders=torch.from_numpy(np.stack(renders)),
        models=torch.tensor([model[o.cad] for _, o in rows]),
    )


def _render(generator: SynthGenerator, o: SynthObject, rng: np.random.Generator) -> np.ndarray:
    """(3, 112, 112) uint8: the model as it is, upright, turned up to half the steps of an index's views."""
    azimuth, elevation = (
        o.rotation.azimuth + rng.uniform(-24, 24),
        o.rotation.elevation + rng.uniform(-14, 14),
    )
    R = rotation_from_angles(azimuth, float(np.clip(elevation, -20.0, 85.0)))
    return np.ascontiguousarray(generator.plain(o.cad, R, SIDE).transpose(2, 0, 1))


def turns_of(found: SynthObject) -> int:
    """Number of azimuths at which an upright object looks the same, 0 for a body of revolution."""
    order = found.symmetry.about((0.0, 1.0, 0.0)).order
    return int(order) if order <= MOST_TURNS else 0


def _worth(o: SynthObject) -> bool:
    return o.visible >= LEAST_VISIBLE and max(o.visible_box.width, o.visible_box.height) >= LEAST_SIDE


def loader(stream: ObjectStream, workers: int, pin: bool = False) -> Iterator[Objects]:
    """Chunks in order, drawn by that many processes, or here if there are none."""
    if workers:
        # A forked process would wait for ever for OpenCV's threads, which stay behind.
        cv2.setNumThreads(1)
    return iter(
        DataLoader(
            stream,
            batch_size=None,
            num_workers=workers,
            prefetch_factor=4 if workers else None,
            pin_memory=pin,
            worker_init_fn=one_thread,
        )
    )


def one_thread(_worker: int) -> None:
    """A core a worker: threads of each would fight for the same cores."""
    torch.set_num_threads(1)
    cv2.setNumThreads(1)
