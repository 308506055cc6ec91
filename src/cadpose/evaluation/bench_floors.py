"""The physical floor of each stage: what its arithmetic and its memory traffic take at the machine's best.

Arithmetic is that of the networks, counted from their graphs and the shapes they were run on, two operations
a product. Memory is what cannot be avoided: templates are read once, and of every view drawn the scene is
read, the samples are written and read, and the picture is written. The machine's best is measured in the
same run: a product of large matrices, and a copy of what fits no cache. All else (decoding, cropping,
matching, searching) counts nothing, so that a stage may be far from its floor with good reason.
"""

from __future__ import annotations

import json
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from math import prod
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any

import numpy as np

from cadpose.detection.ssd import NAME as SSD
from cadpose.detection.ssd import ssd_graph
from cadpose.onnx_session import watched
from cadpose.pipeline import SIDE, Annotator
from cadpose.records import Annotation, CadModel, Detection, Photo
from cadpose.rendering.raster import Rasteriser

#: A run of a network: its name and the shapes of its inputs.
Run = tuple[str, tuple[tuple[str, tuple[int, ...]], ...]]
_MATRIX, _COPIED = 1536, 1 << 26
_KINDS = {"tensor(uint8)": np.uint8, "tensor(int8)": np.int8, "tensor(float)": np.float32}
#: Bytes of a sample while it is drawn, and of a pixel when it is done: colour, coverage, depth.
_SAMPLE_BYTES, _PIXEL_BYTES = 8, 8


@dataclass(frozen=True)
class Machine:
    """What the machine did best in this run.

    Attributes:
        gflops: 10⁹ single-precision operations a second in a product of matrices, by BLAS on its threads.
        gflops_one_core: The same of one core's time.
        gbytes: 10⁹ bytes a second read and written in a copy.
    """

    gflops: float
    gflops_one_core: float
    gbytes: float


@dataclass(frozen=True)
class Floor:
    """What a stage cannot do without.

    Attributes:
        gflop: 10⁹ operations of its networks.
        mbytes: 10⁶ bytes of templates and views.
    """

    gflop: float
    mbytes: float

    def ms(self, machine: Machine) -> float:
        """Milliseconds, arithmetic and memory one after the other."""
        return 1000.0 * self.gflop / machine.gflops + self.mbytes / machine.gbytes


def measure_machine(repeats: int = 7) -> Machine:
    """The best of some repeats; about a second."""
    a = np.random.default_rng(0).random((_MATRIX, _MATRIX), np.float32)
    product, source = np.empty_like(a), np.zeros(_COPIED, np.uint8)
    target = np.empty_like(source)
    seconds, core_seconds = _best(lambda: np.matmul(a, a, out=product), repeats)
    copying, _ = _best(lambda: np.copyto(target, source), repeats)
    work = 2.0 * _MATRIX**3 / 1e9
    return Machine(work / seconds, work / core_seconds, 2.0 * _COPIED / copying / 1e9)


def _best(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least seconds by the clock, and of all cores together, of some runs after one that is not counted."""
    work()
    clock, cores = [], []
    for _ in range(repeats):
        start, busy = time.perf_counter(), time.process_time()
        work()
        clock.append(time.perf_counter() - start)
        cores.append(time.process_time() - busy)
    return min(clock), max(min(cores), 1e-9)


def measure_floors(annotator: Annotator, photo: Photo) -> dict[str, Floor]:
    """The floor of each stage for a photo with one object, on the CPU.

    Raises:
        ValueError: another number of objects was found in the photo.
        CadposeError: the object cannot be annotated.
    """
    detections: list[Detection] = []
    runs = {"detect": _counted(lambda: detections.extend(annotator.detector.detect(photo)))}
    if len(detections) != 1:
        raise ValueError(f"the detector finds {len(detections)} objects in {photo.name}, not one")
    (first,) = detections
    cads = annotator.candidates(first.category)
    found: list[Annotation] = []
    whole = _counted(lambda: found.append(annotator.annotate_object(photo, first, cads)))
    box = found[0].detection.box
    hypotheses = annotator.estimate_rotation(photo, box, first.category, cads)
    runs["mask"] = _counted(lambda: annotator.masks.mask(photo, box))
    runs["rotation"] = _counted(lambda: annotator.estimate_rotation(photo, box, first.category, cads))
    runs["similarity"] = _counted(lambda: annotator.rank_jointly(photo, box, cads, hypotheses))
    runs["alignment"] = whole - runs["mask"] - runs["rotation"] - runs["similarity"]
    best = found[0].candidates
    refined = found[0].refinement
    drawn = {
        "similarity": [c.cad for c in best if "aligned" in c.measures],
        "alignment": [best[0].cad] * (0 if refined is None else refined.evaluations),
    }
    templates = sum(annotator.joint.source.views(cad).cells.nbytes for cad in cads) / 1e6
    read = {"rotation": templates}
    return {
        stage: Floor(
            sum(count * operations(run) for run, count in counts.items()) / 1e9,
            sum(_view_bytes(annotator, cad) for cad in drawn.get(stage, [])) / 1e6 + read.get(stage, 0.0),
        )
        for stage, counts in runs.items()
    }


def _counted(work: Callable[[], object]) -> Counter[Run]:
    """How often each network was run on what shapes."""
    runs: Counter[Run] = Counter()
    lock = Lock()

    def watch(name: str, inputs: Mapping[str, Any]) -> None:
        shapes = tuple(sorted((key, np.shape(value)) for key, value in inputs.items()))
        with lock:
            runs[name, shapes] += 1

    with watched(watch):
        work()
    return runs


def _view_bytes(annotator: Annotator, cad: CadModel) -> float:
    renderer = annotator.renderer
    samples = renderer.supersample if isinstance(renderer, Rasteriser) else 1
    mesh = annotator.library.mesh(cad)
    scene = mesh.vertices.nbytes + mesh.faces.nbytes
    return scene + 2.0 * _SAMPLE_BYTES * (SIDE * samples) ** 2 + _PIXEL_BYTES * SIDE**2


@lru_cache(maxsize=64)
def operations(run: Run) -> float:
    """Operations of one run: twice the products of convolutions and of matrices.

    ONNX Runtime's own profile of such a run tells the shapes.
    """
    import onnxruntime as ort

    name, shapes = run
    network = _network(name)
    if network is None:
        return 0.0
    options = ort.SessionOptions()
    options.graph_optimization_level = ort.GraphOptimizationLevel.ORT_DISABLE_ALL
    options.enable_profiling = True
    with TemporaryDirectory() as folder:
        options.profile_file_prefix = str(Path(folder) / "profile")
        session = ort.InferenceSession(network, options, providers=["CPUExecutionProvider"])
        kinds = {tensor.name: _KINDS[tensor.type] for tensor in session.get_inputs()}
        session.run(None, {key: np.zeros(shape, kinds[key]) for key, shape in shapes})
        events = json.loads(Path(session.end_profiling()).read_text(encoding="utf-8"))
    total = 0.0
    for event in events:
        told = event.get("args", {})
        if told.get("op_name") in ("Conv", "Gemm", "MatMul") and "output_type_shape" in told:
            first, second = (_shape(told["input_type_shape"][i]) for i in (0, 1))
            each = prod(second[1:]) if told["op_name"] == "Conv" else first[-1]
            total += 2.0 * prod(_shape(told["output_type_shape"][0])) * each
    return total


def _shape(told: dict[str, list[int]]) -> list[int]:
    (sizes,) = told.values()
    return sizes


def _network(name: str) -> bytes | None:
    """A network of this package, or the detector's; None for another."""
    if name == SSD:
        return ssd_graph().network
    path = Path(str(files("cadpose") / "data" / "weights" / name))
    return path.read_bytes() if name and path.is_file() else None
