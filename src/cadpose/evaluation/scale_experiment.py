"""How the view index grows with its library: size, build rate, memory, time of a query, recall."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.backends import encoder_on
from cadpose.errors import InputError
from cadpose.evaluation.scale_library import WarpedSource
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.library.storage import write_atomic
from cadpose.records import Rotation
from cadpose.similarity.embedding import ViewEmbedder
from cadpose.similarity.index.build import build_index
from cadpose.similarity.index.describe import ViewDescriber
from cadpose.similarity.index.library_index import LibraryIndex
from cadpose.similarity.index.segments import MANIFEST, SegmentStore
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.generator import SynthGenerator

#: Names within the folder.
INDEX, SETTINGS, BUILT, RESULTS, PLOT = "index", "settings.json", "built.jsonl", "scale.json", "scale.png"
#: Models that a query finds and ranks again.
TOP = 50


@dataclass(frozen=True)
class QueryFigures:
    """What queries of one kind took and found.

    Attributes:
        median_ms: Embedding, search and ranking of 50 again, half of the queries took less.
        p95_ms: 95 of 100 took less.
        recall: Share of the 50 nearest by exact search that FAISS found too.
        found: Share of the queries whose own model is among the 50; copies of it are others.
    """

    median_ms: float
    p95_ms: float
    recall: float
    found: float


@dataclass(frozen=True)
class ScaleRow:
    """An index of one size.

    Attributes:
        models: How many it holds.
        megabytes: On disk.
        build_seconds: To make it from nothing, summed over the runs that it took; what a killed run had not
            yet committed is left out.
        models_per_second: Over the same time.
        cpu_ms_a_model: Time of all cores; unlike the rate it hardly depends on what else runs.
        open_seconds: From disk until it can be asked.
        peak_rss_gb: Most memory of this process so far.
        filtered: Queries with category and rotation.
        unfiltered: Queries among all models and views.
    """

    models: int
    megabytes: float
    build_seconds: float
    models_per_second: float
    cpu_ms_a_model: float
    open_seconds: float
    peak_rss_gb: float
    filtered: QueryFigures
    unfiltered: QueryFigures


@dataclass(frozen=True, eq=False)
class _Query:
    rgb: NDArray[np.uint8]
    box: Box
    category: str
    rotation: Rotation
    cad: str


def run_scale(
    out: Path,
    library: Library,
    sizes: Sequence[int],
    network: bytes,
    *,
    queries: int = 40,
    workers: int = 1,
    seed: int = 0,
    device: str = "cpu",
    resume: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[ScaleRow]:
    """Build one index step by step, as ``cadpose library index`` does, and ask it at every size.

    Args:
        out: Folder of the index and the results.
        library: The real models; warped copies make up the rest.
        sizes: Numbers of models.
        network: The view embedding, ONNX.
        queries: Synthetic photos of the real models; of each the main object is looked for.
        workers: Threads that build.
        seed: Of warps and photos.
        device: Where networks run.
        resume: Go on with a folder of the same settings.
        progress: Told (models done, models in all).

    Raises:
        InputError: the folder holds another experiment, or one that ``resume`` was not asked for; or its
            index has grown beyond a size that was not measured.
        DependencyError: there is no such device.
        LibraryError: the library or the index is damaged.
        OSError: the folder cannot be written.
    """
    encoder_on(device)  # refuses a device that is not there
    describer = ViewDescriber(ViewEmbedder(network, device, threads=1), device=device)
    settings = {**describer.settings, "library": library.digest, "seed": seed, "queries": queries}
    rows = {row.models: row for row in _claim(out, settings, resume)}
    there = _indexed(out / INDEX)
    outgrown = [size for size in sorted(set(sizes) - set(rows)) if size < there]
    if outgrown:
        raise InputError(
            f"{out / INDEX} holds {there} models already, more than {outgrown[0]}: name other numbers, or "
            "another folder"
        )
    asked = _queries(library, queries, seed)
    most = max(sizes)
    for size in sorted(set(sizes)):
        if size in rows:
            continue
        _build(out, WarpedSource(library, size, seed), describer, workers, most, progress)
        rows[size] = _measure(out, size, asked, network, device)
        told = [asdict(rows[n]) for n in sorted(rows)]
        write_atomic(out / RESULTS, (json.dumps(told, indent=1) + "\n").encode())
    return [rows[size] for size in sorted(set(sizes))]


def _build(
    out: Path,
    source: WarpedSource,
    describer: ViewDescriber,
    workers: int,
    most: int,
    progress: Callable[[int, int], None],
) -> None:
    built = _built(out)
    last, last_cpu = time.perf_counter(), time.process_time()

    def committed(models: int) -> None:
        nonlocal last, last_cpu
        now, cpu = time.perf_counter(), time.process_time()
        built.append({"models": models, "seconds": now - last, "cpu": cpu - last_cpu})
        write_atomic(out / BUILT, "".join(json.dumps(part) + "\n" for part in built).encode())
        last, last_cpu = now, cpu

    report = build_index(
        out / INDEX,
        source,
        describer,
        workers=workers,
        progress=lambda done, total: progress(done, most),
        committed=committed,
    )
    if report.failed:
        raise InputError(f"{report.failed[0][0]} cannot be indexed: {report.failed[0][1]}")


def _measure(out: Path, size: int, asked: Sequence[_Query], network: bytes, device: str) -> ScaleRow:
    start = time.perf_counter()
    index = LibraryIndex.open(out / INDEX, ViewEmbedder(network, device), device)
    opened = time.perf_counter() - start
    if len(index) != size:
        raise InputError(f"{out / INDEX} holds {len(index)} models, not {size}: name another folder")
    models = seconds = cpu = 0.0
    for part in _built(out):
        if models >= size:
            break
        models, seconds, cpu = models + part["models"], seconds + part["seconds"], cpu + part["cpu"]
    if not models:
        raise InputError(f"{out / BUILT} does not tell how the index was built: name another folder")
    return ScaleRow(
        models=size,
        megabytes=sum(path.stat().st_size for path in (out / INDEX).iterdir()) / 1e6,
        build_seconds=seconds,
        models_per_second=models / seconds,
        cpu_ms_a_model=1000.0 * cpu / models,
        open_seconds=opened,
        filtered=_figures(index, asked, network, True),
        unfiltered=_figures(index, asked, network, False),
        peak_rss_gb=peak_rss_gb(),
    )


def _indexed(folder: Path) -> int:
    """How many models an index holds; none if it is not there."""
    if not (folder / MANIFEST).is_file():
        return 0
    store = SegmentStore.open(folder)
    return sum(len(store.read(name).entries) for name in store.names)


def _built(out: Path) -> list[dict[str, float]]:
    """What each segment took; a last line that was cut is left out.

    Raises:
        InputError: another line is damaged.
    """
    path = out / BUILT
    lines = path.read_text(encoding="utf-8", errors="replace").splitlines() if path.is_file() else []
    built: list[dict[str, float]] = []
    for number, line in enumerate(lines, 1):
        try:
            told = json.loads(line)
            built.append(
                {"models": int(told["models"]), "seconds": float(told["seconds"]), "cpu": float(told["cpu"])}
            )
        except (ValueError, KeyError, TypeError) as error:
            if number < len(lines):
                raise InputError(f"{path} is damaged in line {number}: name another folder") from error
    return built


def _figures(index: LibraryIndex, asked: Sequence[_Query], network: bytes, filtered: bool) -> QueryFigures:
    embedder = ViewEmbedder(network)
    times, recall, found = [], [], []
    for number, query in enumerate([asked[0], *asked]):
        category = query.category if filtered else None
        rotations = [query.rotation] if filtered else []
        start = time.perf_counter()
        matches = index.query(query.rgb, query.box, category=category, rotations=rotations, top=TOP)
        took = time.perf_counter() - start
        if number == 0:
            continue  # compiles and warms up
        times.append(1000.0 * took)
        found.append(any(match.cad == f"{query.cad}#0000" for match in matches))
        embedding = embedder.crop(query.rgb, query.box)
        views = index.grid.nearest(rotations)
        near, _ = index.vectors.search(embedding, views, category, TOP)
        exact, _ = index.vectors.exact(embedding, views, category, TOP)
        # A small index may have no model of the photo's category: then there is nothing to miss.
        recall.append(len(np.intersect1d(near, exact)) / len(exact) if len(exact) else 1.0)
    median, p95 = np.percentile(times, (50, 95))
    return QueryFigures(float(median), float(p95), float(np.mean(recall)), float(np.mean(found)))


def _queries(library: Library, count: int, seed: int) -> list[_Query]:
    generator = SynthGenerator(
        library.models(), library.mesh, library.symmetry, Backdrops(), seed=seed, kept_bytes=64 << 20
    )
    found: list[_Query] = []
    number = 0
    while len(found) < count:
        photo = generator.photo(number)
        number += 1
        if photo.objects:
            one = photo.objects[0]
            found.append(_Query(photo.rgb, one.box, one.category, one.rotation, one.cad))
    return found


def peak_rss_gb() -> float:
    """Most memory that this process has held, in 10^9 bytes."""
    import resource  # not on Windows

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return most / 1e9 if sys.platform == "darwin" else most * 1024 / 1e9


def _claim(out: Path, settings: dict[str, Any], resume: bool) -> list[ScaleRow]:
    """Make the folder this experiment's own, or see that it is; what it has measured."""
    path, told = out / SETTINGS, json.loads(json.dumps(settings))
    if not path.is_file():
        if (out / INDEX).exists():
            raise InputError(f"{out} holds something else: name another folder")
        out.mkdir(parents=True, exist_ok=True)
        write_atomic(path, (json.dumps(told, indent=1) + "\n").encode())
        return []
    if not resume:
        raise InputError(f"{out} holds an experiment already: add --resume, or name another folder")
    try:
        before = json.loads(path.read_bytes())
        other = [key for key in told if before.get(key) != told[key]]
        if other:
            raise InputError(
                f"{out} was made with other settings ({', '.join(other)}): use the same, or another folder"
            )
        results = out / RESULTS
        return [_row(entry) for entry in json.loads(results.read_bytes())] if results.is_file() else []
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{out} is damaged ({error}): name another folder") from error


def _row(entry: dict[str, Any]) -> ScaleRow:
    queries = {kind: QueryFigures(**entry[kind]) for kind in ("filtered", "unfiltered")}
    return ScaleRow(**(entry | queries))


def scale_plot(rows: Sequence[ScaleRow]) -> bytes:
    """The bytes of a PNG: how size, memory, query time and build rate grow with the number of models.

    Raises:
        DependencyError: matplotlib is not installed.
    """
    from cadpose.evaluation.figures import figure_png, new_figure

    figure, axes = new_figure(4, size=(6.4, 9.6), sharex=True)
    models = [row.models for row in rows]
    lines: tuple[tuple[str, list[tuple[str, list[float]]]], ...] = (
        ("on disk, MB", [("", [row.megabytes for row in rows])]),
        ("most memory, GB", [("", [row.peak_rss_gb for row in rows])]),
        (
            "a query, ms (median)",
            [
                ("category and rotation", [row.filtered.median_ms for row in rows]),
                ("all models, all views", [row.unfiltered.median_ms for row in rows]),
            ],
        ),
        ("built, models/s", [("", [row.models_per_second for row in rows])]),
    )
    for each, (name, curves) in zip(axes, lines, strict=True):
        for label, values in curves:
            each.plot(models, values, marker="o", label=label or None)
        each.set(ylabel=name, ylim=(0, None))
        each.grid(color="#e5e8eb", lw=0.8)
        if len(curves) > 1:
            each.legend(frameon=False, fontsize=8)
    axes[-1].set(xlabel="models", xlim=(0, None))
    return figure_png(figure)
