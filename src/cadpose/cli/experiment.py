"""``cadpose experiment``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import typer

from cadpose.cli.options import (
    Backgrounds,
    Categories,
    Device,
    Json,
    LibraryFolder,
    Panoramas,
    PhotoSide,
    Samples,
    Seed,
    make_annotator,
)
from cadpose.cli.output import complain, progress_bar
from cadpose.cli.retrieval import (
    Measures,
    RejectFlagged,
    Report,
    flagged_are_predicted,
    photo_progress,
    tell,
)
from cadpose.cli.scale import scale
from cadpose.cli.targets import check_targets

app = typer.Typer(help="Experiments of papers, rebuilt, and how the index scales.", no_args_is_help=True)
app.command("scale")(scale)


@app.command("paper")
def paper(
    out: Annotated[Path, typer.Argument(help="Folder for gallery, photos, labels, outcomes and tables.")],
    renderer: Annotated[
        Literal["auto", "blender", "raster"],
        typer.Option("--renderer", help="What draws the photos; auto: Blender where it is set up."),
    ] = "auto",
    photos: Annotated[int, typer.Option("--photos", min=1, help="Photos a category.")] = 100,
    models: Annotated[int, typer.Option("--models", min=2, help="CAD models a category.")] = 10,
    category: Categories = None,
    size: PhotoSide = 320,
    samples: Samples = 16,
    backgrounds: Backgrounds = None,
    hdri: Panoramas = None,
    measure: Measures = None,
    rotation: Annotated[
        Literal["predicted", "true"], typer.Option("--rotation", help="Rotation that models are compared at.")
    ] = "predicted",
    boxes: Annotated[
        Literal["detected", "true"], typer.Option("--boxes", help="Boxes of the detector, or the true ones.")
    ] = "detected",
    reject_flagged: RejectFlagged = False,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes that draw; one a core unless told.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a folder of the same settings.")
    ] = False,
    report: Report = None,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """The paper's set-up on synthetic photos: its ten categories, ten models each; Tables 1 to 4.

    Exit code 1: a photo could not be used; the others were evaluated.
    """
    from cadpose.evaluation.figures import require_matplotlib
    from cadpose.evaluation.paper_experiment import (
        EVALUATION,
        GALLERY,
        MEASURES,
        SETTINGS,
        PaperSetup,
        draw_paper_set,
        evaluate_paper_set,
        usual_renderer,
    )
    from cadpose.evaluation.paper_photos import PHOTOS
    from cadpose.evaluation.retrieval_job import TABLE_FILES
    from cadpose.evaluation.retrieval_store import OUTCOMES
    from cadpose.evaluation.retrieval_store import SETTINGS as OUTCOME_SETTINGS
    from cadpose.library.catalogue import Library
    from cadpose.library.class_map import PAPER_CATEGORIES
    from cadpose.training.synth.writer import LABELS

    flagged_are_predicted(reject_flagged, rotation)
    # The photos are written first and read then.
    inputs = [out / PHOTOS, *(folder for folder in (backgrounds, hdri) if folder is not None)]
    own = [out, *(out / name for name in (SETTINGS, GALLERY, LABELS, EVALUATION))]
    own += [out / EVALUATION / name for name in (OUTCOME_SETTINGS, OUTCOMES, *TABLE_FILES)]
    check_targets([("--report", report)], [("OUT", path) for path in own], inputs)
    drawn_by = usual_renderer() if renderer == "auto" else renderer
    if renderer == "auto" and drawn_by == "raster":
        complain("Blender is not set up, the rasteriser draws: a quick look only (`cadpose blender setup`)")
    if report is not None:
        require_matplotlib()
    setup = PaperSetup(
        drawn_by,
        tuple(sorted(set(category or PAPER_CATEGORIES))),
        models,
        photos,
        size,
        samples,
        backgrounds,
        hdri,
        seed,
    )
    with progress_bar("draw", len(setup.categories) * photos) as bar:
        gallery = draw_paper_set(
            setup,
            out,
            Library.open(library),
            workers=workers or os.cpu_count() or 1,
            resume=resume,
            progress=lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total),
        )
    annotator = make_annotator(library, device=device, seed=seed, candidates=models, masks="grabcut")
    with photo_progress("retrieval") as progress:
        tables, outcomes = evaluate_paper_set(
            out,
            gallery,
            annotator,
            measures=tuple(measure or MEASURES),
            rotation=rotation,
            boxes=boxes,
            reject_flagged=reject_flagged,
            device=device,
            seed=seed,
            resume=resume,
            progress=progress,
        )
    tell(tables, outcomes, annotator, report, json)
