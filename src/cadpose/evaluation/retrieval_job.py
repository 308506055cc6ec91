"""One retrieval evaluation from start to end: what `cadpose evaluate retrieval` and experiments run."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import cadpose
from cadpose.datasets.files import MAX_JSONL_BYTES, read_bytes, read_json
from cadpose.datasets.gallery import read_gallery
from cadpose.errors import InputError
from cadpose.evaluation.contest import Contest, make_contest
from cadpose.evaluation.retrieval import Outcome, RetrievalRun, evaluate_retrieval
from cadpose.evaluation.retrieval_inputs import (
    Rotations,
    choose_labels,
    detected_box,
    gallery_candidates,
    labelled_box,
    library_candidates,
    predicted_rotation,
    rotations_of_file,
    true_rotation,
)
from cadpose.evaluation.retrieval_store import OutcomeStore
from cadpose.evaluation.retrieval_summary import ACCEPT, retrieval_tables
from cadpose.evaluation.retrieval_tables import RetrievalTables
from cadpose.evaluation.symmetry import label_symmetry
from cadpose.library.storage import sha256_of, write_atomic
from cadpose.pipeline import Annotator
from cadpose.similarity import triplet

BoxesFrom = Literal["true", "detected"]
#: Files of the tables in the output folder, beside the store's own.
TABLE_FILES = ("tables.txt", "tables.csv", "tables.json")
#: What `cadpose synth` and experiments keep beside their labels; it tells what drew the photos.
_RECIPE = "recipe.json"
_DRAWN_WITH = {"blender": "Blender", "raster": "the rasteriser"}


@dataclass(frozen=True)
class RetrievalJob:
    """What is evaluated.

    Attributes:
        dataset: Label file.
        gallery: Gallery file; None for the library's representatives and the true model.
        measures: Names, see `cadpose.evaluation.contest.make_contest`.
        rotation: ``"true"``, ``"predicted"``, or the path of a label file with rotations.
        boxes: Labelled boxes, or those of the detector.
        reject_flagged: Reject photos whose predicted rotation is flagged for review.
        category: Only this one.
        split: See `cadpose.evaluation.retrieval_inputs.choose_labels`.
        limit: Photos a category at most.
        accept: Probability from which a first candidate is accepted.
        device: ``"cpu"`` or ``"cuda"``.
        seed: Seed of everything random.

    Raises:
        ValueError: a value is none of those above, or flagged rotations that are not predicted shall be
            rejected.
    """

    dataset: Path
    gallery: Path | None = None
    measures: tuple[str, ...] = ("aligned",)
    rotation: str = "predicted"
    boxes: BoxesFrom = "true"
    reject_flagged: bool = False
    category: str | None = None
    split: str = "all"
    limit: int | None = None
    accept: float = ACCEPT
    device: str = "cpu"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.boxes not in get_args(BoxesFrom):
            raise ValueError(f"boxes must be one of {', '.join(get_args(BoxesFrom))}, got {self.boxes!r}")
        if not self.measures:
            raise ValueError("at least one measure must be named")
        if self.limit is not None and self.limit < 1:
            raise ValueError(f"limit must be at least 1 or None, got {self.limit}")
        if not 0.0 <= self.accept <= 1.0:
            raise ValueError(f"accept must lie in [0, 1], got {self.accept}")
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed}")
        if self.reject_flagged and self.rotation != "predicted":
            raise ValueError(f"only predicted rotations are flagged, got rotation {self.rotation!r}")


@dataclass(frozen=True)
class Progress:
    """Whom to tell what.

    Attributes:
        total: Told the number of photos before the first one.
        done: Told of each photo.
        left_out: Told why a measure is missing.
    """

    total: Callable[[int], None] = lambda photos: None
    done: Callable[[], None] = lambda: None
    left_out: Callable[[str], None] = lambda reason: None


def run_job(
    job: RetrievalJob,
    annotator: Annotator,
    out: Path | None = None,
    *,
    resume: bool = False,
    beside_paper: bool = False,
    notes: tuple[str, ...] = (),
    progress: Progress | None = None,
) -> tuple[RetrievalTables, list[Outcome]]:
    """Evaluate, and keep outcomes and tables in a folder.

    Args:
        job: What to evaluate.
        annotator: Draws, detects and estimates.
        out: Folder for outcomes and tables; None keeps nothing.
        resume: Go on with the outcomes in ``out``, which were made with the same settings.
        beside_paper: Show the paper's own tables too.
        notes: Sentences that the tables shall tell.
        progress: Whom to tell.

    Returns:
        The tables, and every photo's outcome in order.

    Raises:
        InputError: a file cannot be used, real and synthetic photos are mixed, or ``out`` is another run's.
        LibraryError: the library lacks a model of the gallery.
        CadposeError: a measure is not known.
        DependencyError: weights or programs are missing.
    """
    progress = progress or Progress()
    labels = choose_labels(job.dataset, job.category, job.split, job.limit)
    contest = make_contest(annotator, job.measures, job.device, job.seed, progress.left_out)
    library = annotator.library
    run = RetrievalRun(
        annotator,
        contest,
        library_candidates(library, annotator.candidate_count)
        if job.gallery is None
        else gallery_candidates(library, read_gallery(job.gallery)),
        labelled_box if job.boxes == "true" else detected_box(annotator),
        _rotations(job, annotator),
        label_symmetry(library, "cad"),
        job.seed,
    )
    store = None if out is None else OutcomeStore(out, _settings(job, annotator, contest), resume)
    known = {} if store is None else store.read(labels, library, contest.names)
    progress.total(len(labels))

    def told(number: int, outcome: Outcome) -> None:
        if store is not None:
            store.append(number, outcome)
        progress.done()

    for _ in known:
        progress.done()
    outcomes = evaluate_retrieval(labels, run.outcome, known, told)
    drawn_with = _drawn_with(job.dataset)
    if labels[0].synthetic and annotator.renderer.name.startswith(drawn_with or "?"):
        notes = (*notes, "The same renderer drew photos and candidates: easier than photographs.")
    tables = retrieval_tables(
        outcomes,
        contest.names,
        dataset=f"{job.dataset.resolve().parent.name}/{job.dataset.name}",
        rotation=_rotation_in_words(job, annotator, contest),
        boxes="as labelled" if job.boxes == "true" else f"detected ({annotator.detector.name})",
        accept=job.accept,
        drawn_with=_DRAWN_WITH.get(drawn_with, drawn_with),
        notes=notes,
        measure_notes={n: f"{n} is {m.name} here." for n, m in contest.measures.items() if m.name != n},
        beside_paper=beside_paper,
    )
    if out is not None:
        told_json = json.dumps(tables.to_json(), indent=1, allow_nan=False) + "\n"
        for name, content in zip(TABLE_FILES, (tables.to_text(), tables.to_csv(), told_json), strict=True):
            write_atomic(out / name, content.encode("utf-8", "backslashreplace"))
    return tables, outcomes


def _rotations(job: RetrievalJob, annotator: Annotator) -> Rotations:
    if job.rotation == "true":
        return true_rotation
    if job.rotation == "predicted":
        return predicted_rotation(annotator, job.reject_flagged)
    return rotations_of_file(Path(job.rotation))


def _rotation_in_words(job: RetrievalJob, annotator: Annotator, contest: Contest) -> str:
    words = []
    if contest.measures:
        if job.rotation == "predicted":
            flagged = ", flagged ones rejected" if job.reject_flagged else ""
            words.append(f"predicted ({annotator.rotation.name}{flagged})")
        else:
            words.append("true" if job.rotation == "true" else f"of {Path(job.rotation).name}")
    if contest.rankers:
        words.append(f"its own for {', '.join(contest.rankers)}")
    return "; ".join(words)


def _drawn_with(dataset: Path) -> str:
    """The renderer that drew a folder of synthetic photos; empty where it is not told."""
    try:
        told = read_json(dataset.parent / _RECIPE)
    except InputError:
        return ""
    name = told.get("renderer") if isinstance(told, dict) else None
    return name if isinstance(name, str) else ""


def _settings(job: RetrievalJob, annotator: Annotator, contest: Contest) -> dict[str, Any]:
    """All that decides the outcomes."""

    def digest(path: Path | None) -> str | None:
        return None if path is None else sha256_of(read_bytes(path, MAX_JSONL_BYTES))

    of_file = job.rotation not in ("true", "predicted")
    # Everything else that measures or estimates comes with cadpose, or is named by what it is.
    networks = {
        name: sha256_of(read_bytes(measure.path, triplet.MAX_BYTES))
        for name, measure in contest.measures.items()
        if isinstance(measure, triplet.TripletMeasure)
    }
    return {
        "cadpose": cadpose.__version__,
        "dataset": digest(job.dataset),
        "gallery": digest(job.gallery),
        "measures": {n: m.name for n, m in contest.measures.items()},
        "rankers": {n: r.name for n, r in contest.rankers.items()},
        "rotation": digest(Path(job.rotation)) if of_file else job.rotation,
        "estimator": annotator.rotation.name,
        "boxes": job.boxes,
        "detector": annotator.detector.name if job.boxes == "detected" else None,
        "reject_flagged": job.reject_flagged,
        "category": job.category,
        "split": job.split,
        "limit": job.limit,
        "candidates": annotator.candidate_count,
        "library": annotator.library.digest,
        "renderer": annotator.renderer.name,
        "seed": job.seed,
        "masks": annotator.masks.name if contest.uses_masks else None,
        "networks": networks,
    }
