"""A folder of synthetic photos with their labels, written by several processes; a stopped run can go on.

Photos are drawn in chunks. A chunk's photos are written first, then one part file that tells its labels:
whatever ends the run, what a part tells of is there. When all chunks are there, the label files are put
together from the parts, in order. So the bytes depend on the recipe alone.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.datasets.files import read_bytes, read_json
from cadpose.datasets.labels import write_labels
from cadpose.errors import CadposeError, InputError
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.training.synth.generator import SynthGenerator
from cadpose.training.synth.labels import coco_of, label_from_json, object_to_json
from cadpose.training.synth.recipe import Recipe

Format = Literal["jpg", "png"]
#: Names within the folder.
PHOTOS, PARTS, RECIPE, MODELS, LABELS, COCO = (
    "photos", "parts", "recipe.json", "models.json", "labels.jsonl", "coco.json",
)  # fmt: skip
#: Photos a chunk at least; chunks are whole series, for those share their shapes.
_CHUNK = 24
_QUALITY = 92
_MAX_PART_BYTES = 64 * 2**20

Entry = dict[str, Any]


@dataclass(frozen=True)
class SynthReport:
    """What was written.

    Attributes:
        out: The folder.
        photos: Photos in it.
        drawn: Those drawn now; the others were there.
        objects: Labelled objects a category.
        truncated: Objects cut off by the photo's border.
        occluded: Objects partly hidden.
    """

    out: Path
    photos: int
    drawn: int
    objects: dict[str, int]
    truncated: int
    occluded: int


@dataclass(frozen=True)
class _Job:
    """A chunk: which photos are to be there, and where."""

    recipe: Recipe
    out: Path
    format: Format
    number: int
    indices: range


def write_photos(
    recipe: Recipe,
    out: Path,
    count: int,
    *,
    format: Format = "jpg",
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> SynthReport:
    """Draw photos 0 to ``count - 1`` of a recipe into a folder, with their labels.

    Args:
        recipe: What to draw.
        out: Folder; made when needed.
        count: How many photos.
        format: JPEG (quality 92) or PNG.
        workers: Processes; 1 draws in this one. With more a script calls this under
            ``if __name__ == "__main__"``, for each of them imports it.
        resume: Go on with a folder of the same recipe: photos that are there are not drawn again.
        progress: Told (photos done, photos in all).

    Raises:
        InputError: the folder is not empty and ``resume`` is not asked for, or it was made by another recipe
            or holds more photos.
        LibraryError: the library or a model of it cannot be read.
        CadposeError: a worker was killed.
        ValueError: ``count`` or ``workers`` is below 1.
    """
    if count < 1 or workers < 1:
        raise ValueError(f"count and workers must be at least 1, got {count} and {workers}")
    _claim(out, {**recipe.to_json(), "format": format}, count, resume)
    series = recipe.options.series
    chunk = series * -(-_CHUNK // series)
    jobs = [
        _Job(recipe, out, format, number, range(first, min(first + chunk, count)))
        for number, first in enumerate(range(0, count, chunk))
    ]
    todo = [job for job in jobs if set(job.indices) - _there(job).keys()]
    drawn, done = 0, count - sum(len(job.indices) for job in todo)
    progress(done, count)
    for made, whole in _run(todo, workers):
        drawn, done = drawn + made, done + whole
        progress(done, count)
    return _assemble(recipe, jobs, drawn)


def _claim(out: Path, recipe: Entry, count: int, resume: bool) -> None:
    """Make the folder this recipe's own, or see that it is."""
    path = out / RECIPE
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: name a folder for the photos")
    if path.is_file():
        if not resume:
            raise InputError(f"{out} holds synthetic photos already: add --resume, or name another folder")
        before = read_json(path)
        if before != recipe:
            keys = sorted(before) if isinstance(before, dict) else []
            other = [k for k in recipe if k not in keys or before[k] != recipe[k]] or ["format"]
            raise InputError(
                f"{out} was made with other settings ({', '.join(other)}): use the same, or another folder"
            )
        most = max((int(p.stem) for p in (out / PHOTOS).glob("[0-9]*.*") if p.stem.isdecimal()), default=-1)
        if most >= count:
            raise InputError(f"{out} holds {most + 1} photos already: ask for as many or more with --count")
        # What a killed run was writing.
        for left in [*(out / PHOTOS).glob(".part-*"), *(out / PARTS).glob(".part-*")]:
            left.unlink(missing_ok=True)
        return
    if out.is_dir() and any(out.iterdir()):
        raise InputError(f"{out} holds other files: name an empty folder or one that is not there")
    write_atomic(path, (json.dumps(recipe, indent=1, sort_keys=True) + "\n").encode())


def _run(jobs: list[_Job], workers: int) -> Iterator[tuple[int, int]]:
    """(photos drawn, photos of the chunk) of each chunk, as they are done."""
    if workers == 1 or len(jobs) < 2:
        if jobs:
            generator = jobs[0].recipe.generator()
            for job in jobs:
                yield _draw(generator, job), len(job.indices)
        return
    context = get_context("spawn")
    with ProcessPoolExecutor(
        min(workers, len(jobs)),
        mp_context=context,
        initializer=_start,
        initargs=(jobs[0].recipe, context.Value("i", 0)),
    ) as pool:
        try:
            futures = {pool.submit(_draw_here, job): job for job in jobs}
            for future in as_completed(futures):
                yield future.result(), len(futures[future].indices)
        except BrokenProcessPool as error:
            raise CadposeError(
                f"{jobs[0].out}: a process that draws photos was killed, perhaps for want of memory, or could"
                " not start: go on with --resume and fewer --workers"
            ) from error
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


#: Of a worker process: its generator, or why it has none.
_own: SynthGenerator | CadposeError | None = None


def _start(recipe: Recipe, started: Any) -> None:
    global _own
    if recipe.renderer == "blender":
        _keep_to_one_core(started)
    # Ctrl-C is the parent's to handle; a worker whose parent was killed would go on for ever.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:
        threading.Thread(target=_follow, args=(parent,), daemon=True).start()
    cv2.setNumThreads(1)
    try:
        _own = recipe.generator()
    except CadposeError as error:  # an error here would break the pool without a word
        _own = error


def _keep_to_one_core(started: Any) -> None:
    """One core a worker: Blender's threads wait by spinning, and would take the cores of the others."""
    if sys.platform == "linux":
        with started.get_lock():
            number, started.value = started.value, started.value + 1
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[number % len(cores)]})


def _follow(parent: Any) -> None:
    parent.join()
    os._exit(1)


def _draw_here(job: _Job) -> int:
    if isinstance(_own, CadposeError):
        raise _own
    assert _own is not None
    return _draw(_own, job)


def _draw(generator: SynthGenerator, job: _Job) -> int:
    """Draw what is missing of a chunk, then write its part; gives how many were drawn."""
    entries = _there(job)
    missing = [i for i in job.indices if i not in entries]
    for i in missing:
        photo = generator.photo(i)
        data = encoded(photo.rgb, job.format)
        write_atomic(job.out / PHOTOS / _name(i, job.format), data)
        entries[i] = {
            "index": i,
            "bytes": len(data),
            "side": photo.rgb.shape[0],
            "objects": [object_to_json(found) for found in photo.objects],
        }
    ordered = [entries[i] for i in job.indices]
    write_atomic(_part(job), json.dumps({"photos": ordered}).encode("ascii"))
    return len(missing)


def encoded(rgb: NDArray[np.uint8], format: Format) -> bytes:
    """The photo as a file's bytes."""
    settings = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY] if format == "jpg" else [cv2.IMWRITE_PNG_COMPRESSION, 3]
    done, data = cv2.imencode(f".{format}", cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR), settings)
    if not done:
        raise RuntimeError(f"OpenCV cannot write {format}")
    return data.tobytes()


def _name(index: int, format: Format) -> str:
    return f"{index:07d}.{format}"


def _part(job: _Job) -> Path:
    return job.out / PARTS / f"{job.number:06d}.json"


def _there(job: _Job) -> dict[int, Entry]:
    """What a chunk's part tells of photos that are there in full, by their numbers."""
    path = _part(job)
    if not path.is_file():
        return {}
    try:
        photos = json.loads(read_bytes(path, _MAX_PART_BYTES))["photos"]
        return {
            entry["index"]: entry
            for entry in photos
            if entry["index"] in job.indices and _size(job, entry["index"]) == entry["bytes"]
        }
    except (ValueError, KeyError, TypeError, InputError):
        return {}  # damaged: drawn again


def _size(job: _Job, index: int) -> int:
    try:
        return (job.out / PHOTOS / _name(index, job.format)).stat().st_size
    except OSError:
        return -1


def _assemble(recipe: Recipe, jobs: list[_Job], drawn: int) -> SynthReport:
    """The label files from the parts."""
    out = jobs[0].out
    entries = [entry for job in jobs for _, entry in sorted(_there(job).items())]
    if len(entries) != sum(len(job.indices) for job in jobs):
        raise InputError(f"{out} was changed while photos were drawn: run again with --resume")
    names = [f"{PHOTOS}/{_name(entry['index'], jobs[0].format)}" for entry in entries]
    photos = list(zip(names, (e["side"] for e in entries), (e["objects"] for e in entries), strict=True))
    write_labels(
        out / LABELS,
        (label_from_json(out / name, found) for name, _, objects in photos for found in objects),
    )
    write_atomic(out / COCO, json.dumps(coco_of(photos)).encode("ascii"))
    found = [entry for _, _, objects in photos for entry in objects]
    write_atomic(out / MODELS, json.dumps(_models(recipe, {e["cad"] for e in found}), indent=1).encode())
    return SynthReport(
        out=out,
        photos=len(photos),
        drawn=drawn,
        objects=dict(sorted(Counter(entry["category"] for entry in found).items())),
        truncated=sum(entry["truncated"] for entry in found),
        occluded=sum(entry["occluded"] for entry in found),
    )


def _models(recipe: Recipe, used: set[str]) -> list[Entry]:
    """Whose models are seen, under which licence, and how they are symmetric."""
    library = Library.open(recipe.library)
    return [
        {
            "cad": model.id,
            "name": model.name,
            "category": model.category,
            "licence": model.licence,
            "creator": model.creator,
            "source": model.source,
            "sha256": model.sha256,
            "symmetry": library.symmetry(model).to_json(),
        }
        for model in map(library.get, sorted(used))
    ]
