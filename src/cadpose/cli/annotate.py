"""``cadpose annotate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cadpose.cli.given import Boxes, DetectionsFile, MaskFiles, Polygons, Rotations, objects_told
from cadpose.cli.options import (
    AlignTo,
    Candidates,
    Categories,
    DetectorName,
    Device,
    Estimator,
    IntrinsicsText,
    Json,
    LibraryFolder,
    MasksName,
    Refine,
    RendererName,
    Seed,
    Similarity,
)
from cadpose.cli.output import complain, print_json, progress_bar
from cadpose.cli.view_index import Embedding


def annotate(
    photos: Annotated[
        list[str],
        typer.Argument(metavar="PHOTO|DIR|GLOB|LIST.txt|-...", help="Photographs; -: a list on stdin."),
    ],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder of the outputs.")] = Path("runs/annotate"),
    store: Annotated[
        str | None,
        typer.Option("--store", help="Also keep them in sqlite:///file.db or postgresql+psycopg://..."),
    ] = None,
    box: Boxes = None,
    polygon: Polygons = None,
    mask: MaskFiles = None,
    category: Categories = None,
    rotation: Rotations = None,
    detections: DetectionsFile = None,
    detector: DetectorName = "embedded",
    masks: MasksName = "network",
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    index: Annotated[
        Path | None,
        typer.Option("--index", help="Choose the candidates by this view index, see `library index`."),
    ] = None,
    embedding: Embedding = None,
    similarity: Similarity = "joint",
    renderer: RendererName = "raster",
    align_to: AlignTo = "box",
    refine: Refine = "fast",
    intrinsics: IntrinsicsText = "exif",
    estimator: Estimator = "embedded",
    workers: Annotated[
        int, typer.Option("--workers", min=1, max=1024, help="Processes that annotate side by side.")
    ] = 1,
    executor: Annotated[
        Literal["local", "ray"],
        typer.Option("--executor", help="Where the workers are: on this machine, or on a Ray cluster."),
    ] = "local",
    photo_timeout: Annotated[
        float,
        typer.Option("--photo-timeout", min=1.0, help="Seconds after which a photo failed; of many workers."),
    ] = 600.0,
    resume: Annotated[bool, typer.Option("--resume", help="Leave alone what is done already.")] = False,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="As --resume, but try again what failed.")
    ] = False,
    parquet: Annotated[
        Path | None, typer.Option("--parquet", help="Write all annotations of the run to this table.")
    ] = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Find the objects, name their CAD models and poses, draw them over the photos.

    Exit code 1: a photo, or an object that was found or given, could not be annotated; the others were.
    """
    if embedding is not None and index is None:
        raise typer.BadParameter("--embedding belongs to --index: name the view index too")
    from cadpose.batch.job import AnnotateJob, AnnotatorOptions
    from cadpose.batch.photo_list import named_photos
    from cadpose.batch.run import RunOptions, annotate_job
    from cadpose.cli.annotate_output import RunOutput, complaints
    from cadpose.intrinsics import Intrinsics

    told = objects_told(box, polygon, mask, category, rotation, detections)
    known = None if told is None else told.open()
    paths = named_photos(photos)
    if (polygon or mask) and len(paths) > 1:
        raise typer.BadParameter(f"--polygon and --mask belong to one photo, {len(paths)} were named")
    options = AnnotatorOptions(
        library=library,
        device=device,
        seed=seed,
        candidates=candidates,
        index=index,
        embedding=embedding,
        similarity=similarity,
        renderer=renderer,
        align_to=align_to,
        refine=refine,
        intrinsics=Intrinsics.from_text(intrinsics),
        estimator=estimator,
        categories=None if told or not category else tuple(category),
        detector=detector,
        masks=masks,
    )
    results = RunOutput(paths, known)
    outcomes = annotate_job(
        AnnotateJob(options, told, store),
        paths,
        out,
        RunOptions(
            resume=resume or retry_failed,
            retry_failed=retry_failed,
            names_matter=told is not None and told.by_name,
            parquet=parquet,
        ),
        workers=workers,
        photo_timeout=photo_timeout,
        executor=executor,
    )
    with progress_bar("annotate", len(paths)) as bar:
        for outcome in outcomes:
            results.add(outcome)
            for sentence in complaints(outcome):
                complain(sentence)
            bar.advance(bar.tasks[0].id)
    if json:
        print_json(results.entries())
    else:
        results.print(out)
    if results.complained:
        raise typer.Exit(1)
