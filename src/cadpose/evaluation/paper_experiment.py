"""The paper's experiment rebuilt from a library: ten categories, ten models each, photos, Tables 1 to 4.

The paper's photos are not published, so photos are drawn: with other light, other colours and textures and
slightly other shapes than the library's models, so that no model equals its photo. What comes of it is the
set-up's result on synthetic photos and is named so everywhere.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, get_args

from cadpose.datasets.files import read_json
from cadpose.datasets.gallery import write_gallery
from cadpose.errors import DependencyError, InputError, LibraryError
from cadpose.evaluation.paper_photos import draw_paper_photos, paper_recipes, photo_options
from cadpose.evaluation.retrieval import Outcome
from cadpose.evaluation.retrieval_job import BoxesFrom, Progress, RetrievalJob, run_job
from cadpose.evaluation.retrieval_tables import RetrievalTables
from cadpose.library.catalogue import Library
from cadpose.library.class_map import PAPER_CATEGORIES
from cadpose.library.storage import write_atomic
from cadpose.pipeline import Annotator
from cadpose.records import CadModel
from cadpose.rendering.blender import blender_python
from cadpose.training.held_out import read_held_out
from cadpose.training.synth.recipe import Recipe
from cadpose.training.synth.writer import LABELS

Renderer = Literal["blender", "raster"]
#: Names within the folder.
SETTINGS, GALLERY, EVALUATION = "recipe.json", "gallery.json", "evaluation"
#: The paper's own measures.
MEASURES = ("sm1", "sm2", "sm3")


@dataclass(frozen=True)
class PaperSetup:
    """What is drawn.

    Attributes:
        renderer: What draws the photos; the rasteriser is for quick looks.
        categories: Some of the paper's ten.
        models: Models a category.
        photos: Photos a category, as many of each model as of the others, as far as they divide.
        size: Side of a photo in pixels.
        samples: Blender's rays a pixel.
        backdrops: Folder of photos to cut backdrops from, None for made-up ones.
        hdri: Folder of panoramas that light Blender's photos, None for made-up light.
        seed: Seed of everything drawn.

    Raises:
        InputError: a category is none of the paper's.
        ValueError: a category is named twice or none is, or a value is out of range.
    """

    renderer: Renderer
    categories: tuple[str, ...] = tuple(sorted(PAPER_CATEGORIES))
    models: int = 10
    photos: int = 100
    size: int = 320
    samples: int = 16
    backdrops: Path | None = None
    hdri: Path | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        if strange := [name for name in self.categories if name not in PAPER_CATEGORIES]:
            ten = ", ".join(sorted(PAPER_CATEGORIES))
            raise InputError(f"{', '.join(strange)} is none of the paper's categories: {ten}")
        if not self.categories or len(set(self.categories)) < len(self.categories):
            raise ValueError(f"at least one category, each once, must be named, got {self.categories}")
        if self.renderer not in get_args(Renderer):
            raise ValueError(
                f"the renderer must be one of {', '.join(get_args(Renderer))}, got {self.renderer!r}"
            )
        for name, value, low in (("size", self.size, 32), ("samples", self.samples, 1)):
            if not low <= value <= 4096:
                raise ValueError(f"{name} must lie between {low} and 4096, got {value}")
        if self.seed < 0:
            raise ValueError(f"seed must not be negative, got {self.seed}")
        if min(self.models, self.photos) < 1:
            raise ValueError(f"models and photos must be at least 1, got {self.models} and {self.photos}")


def usual_renderer() -> Renderer:
    """Blender where it is set up, else the rasteriser."""
    try:
        blender_python()
    except DependencyError:
        return "raster"
    return "blender"


def paper_gallery(
    library: Library, categories: Sequence[str] = PAPER_CATEGORIES, models: int = 10
) -> dict[str, tuple[CadModel, ...]]:
    """Models that differ from one another, as the paper chose its ten: Sweet Home 3D's first.

    Within a source those come first that show most of how the category varies; then models of other sources,
    then ones made by formula.

    Raises:
        LibraryError: a category has too few models that differ.
    """
    known, gallery, short = library.categories(), {}, []
    for category in categories:
        count = known.get(category, 0)
        spread = library.representatives(category, count) if count else ()
        # Sorting keeps the order within a source.
        chosen = tuple(sorted(spread, key=_source)[:models])
        if len(chosen) < models:
            short.append((category, len(chosen)))
        gallery[category] = chosen
    if short:
        few = ", ".join(f"{category} {count}" for category, count in short)
        options = " ".join(f"--category {category}" for category, _ in short)
        # Near duplicates are passed over, so ten that were made may not be enough.
        made = max(sum(_source(m) == 2 for m in library.models(category)) for category, _ in short)
        raise LibraryError(
            f"the set-up needs {models} models that differ of each category and the library has only: {few}; "
            f"add some with `cadpose library add parametric {options} --limit {made + models}`"
        )
    return gallery


def draw_paper_set(
    setup: PaperSetup,
    out: Path,
    library: Library,
    *,
    workers: int = 1,
    resume: bool = False,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> dict[str, tuple[CadModel, ...]]:
    """Choose the models and draw the photos: ``gallery.json``, ``labels.jsonl`` and ``photos/`` in a folder.

    Args:
        setup: What is drawn.
        out: Folder for all of it.
        library: Where the models are.
        workers: Processes; with more than one a script calls this under ``if __name__ == "__main__"``.
        resume: Go on with a folder of the same settings.
        progress: Told (photos drawn, photos in all).

    Returns:
        The models by category.

    Raises:
        InputError: the folder is another run's.
        LibraryError: the library has too few models.
        DependencyError: Blender is not set up.
    """
    gallery = paper_gallery(library, setup.categories, setup.models)
    base = Recipe.from_library(
        library,
        setup.categories,
        only={model.id for models in gallery.values() for model in models},
        backdrops=setup.backdrops,
        options=photo_options(setup.size),
        seed=setup.seed,
        renderer=setup.renderer,
        hdri=setup.hdri,
        samples=setup.samples,
    )
    recipes = paper_recipes(base, gallery)
    told = {category: recipe.to_json() for category, recipe in recipes.items()}
    _claim(out, {**_settings(setup), "recipes": told}, resume)
    write_gallery(out / GALLERY, {category: [m.id for m in models] for category, models in gallery.items()})
    draw_paper_photos(recipes, out, setup.photos, workers=workers, resume=resume, progress=progress)
    return gallery


def evaluate_paper_set(
    out: Path,
    gallery: Mapping[str, Sequence[CadModel]],
    annotator: Annotator,
    *,
    measures: tuple[str, ...] = MEASURES,
    rotation: Literal["predicted", "true"] = "predicted",
    boxes: BoxesFrom = "detected",
    reject_flagged: bool = False,
    device: str = "cpu",
    seed: int = 0,
    resume: bool = False,
    progress: Progress | None = None,
) -> tuple[RetrievalTables, list[Outcome]]:
    """Tables 1 to 4 of a folder that `draw_paper_set` filled; they go to ``out/evaluation``.

    Args:
        out: The folder.
        gallery: What `draw_paper_set` gave.
        annotator: Draws candidates, detects and estimates, over the same library.
        measures: What ranks.
        rotation, boxes, reject_flagged, device, seed: As of `RetrievalJob`.
        resume: Go on with an evaluation of the same settings.
        progress: Whom to tell.

    Returns:
        The tables, the paper's own beside them, and every photo's outcome.

    Raises:
        InputError: the folder holds an evaluation with other settings.
        DependencyError: weights or programs are missing.
    """
    job = RetrievalJob(
        out / LABELS, out / GALLERY, measures, rotation, boxes, reject_flagged, device=device, seed=seed
    )
    notes = notes_on(gallery, rotation)
    return run_job(
        job, annotator, out / EVALUATION, resume=resume, beside_paper=True, notes=notes, progress=progress
    )


def notes_on(gallery: Mapping[str, Sequence[CadModel]], rotation: str) -> tuple[str, ...]:
    """What a reader has to know of the set-up."""
    models = [model for some in gallery.values() for model in some]
    sources = [("Sweet Home 3D", 0), ("other files", 1), ("made by formula", 2)]
    counts = [(name, sum(_source(model) == rank for model in models)) for name, rank in sources]
    told = ", ".join(f"{count} {name}" for name, count in counts if count)
    notes = [
        f"The paper's set-up with other models ({told}) and drawn photos: other light, other colours and "
        "textures, shapes changed by up to about 10 %. Its figures below are of its own photos."
    ]
    if rotation == "predicted":
        held = {cad for ids in read_held_out().values() for cad in ids}
        kept = sum(model.id in held for model in models)
        notes.append(
            f"Of the {len(models)} models {kept} were held out when the embedded rotation network was "
            "trained; it may have seen drawings of the others."
        )
    return tuple(notes)


def _source(model: CadModel) -> int:
    """0 for Sweet Home 3D, 2 for models made by formula, 1 for all others."""
    if model.source.startswith("sweethome3d"):
        return 0
    return 2 if model.source == "parametric" else 1


def _settings(setup: PaperSetup) -> dict[str, Any]:
    told = asdict(setup)
    # The recipes have digests of what lies in these folders.
    told.update(backdrops=setup.backdrops is not None, hdri=setup.hdri is not None)
    return {"experiment": "paper", **told}


def _claim(out: Path, settings: Mapping[str, Any], resume: bool) -> None:
    """Make the folder this experiment's own, or see that it is."""
    path, told = out / SETTINGS, json.loads(json.dumps(settings))
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file: name a folder for the experiment")
    if path.is_file():
        if not resume:
            raise InputError(f"{out} holds an experiment already: add --resume, or name another folder")
        before = read_json(path)
        if before != told:
            known = before if isinstance(before, dict) else {}
            other = [key for key in told if known.get(key) != told[key]] or ["experiment"]
            raise InputError(
                f"{out} was made with other settings ({', '.join(other)}): use the same, or another folder"
            )
        return
    if out.is_dir() and any(out.iterdir()):
        raise InputError(f"{out} holds other files: name an empty folder or one that is not there")
    write_atomic(path, (json.dumps(told, indent=1) + "\n").encode())
