"""``cadpose evaluate alignment``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cadpose.cli.evaluated import (
    Csv,
    LabelCategory,
    OutlineReport,
    SpreadSplit,
    name_unused,
    print_tables,
    write_csv,
)
from cadpose.cli.options import (
    AlignTo,
    Candidates,
    Device,
    Estimator,
    Json,
    LibraryFolder,
    MasksName,
    RendererName,
    Seed,
    make_annotator,
)
from cadpose.cli.output import progress_bar
from cadpose.cli.targets import check_targets


def _known_modes(names: list[str] | None) -> list[str] | None:
    from cadpose.alignment.refinement.refine import MODES

    for name in names or ():
        if name not in MODES:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(MODES)}")
    return names


def alignment(
    dataset: Annotated[Path, typer.Argument(help="Label file or data set with rotations and CAD models.")],
    kind: Annotated[
        Literal["labels", "pix3d", "bop"], typer.Option("--kind", help="How the data set is laid out.")
    ] = "labels",
    refine: Annotated[
        list[str] | None,
        typer.Option(
            "--refine",
            callback=_known_modes,
            help="off, fast or full; repeatable; all three unless told.",
        ),
    ] = None,
    cad: Annotated[
        Literal["true", "chosen"],
        typer.Option("--cad", help="Place the labelled model, or the one ranked first."),
    ] = "true",
    rotation: Annotated[
        Literal["true", "predicted"], typer.Option("--rotation", help="Begin as labelled or as estimated.")
    ] = "predicted",
    gallery: Annotated[
        Path | None,
        typer.Option("--gallery", help="With --cad chosen: JSON array of CAD ids to choose among."),
    ] = None,
    masks: MasksName = "network",
    labelled_masks: Annotated[
        bool, typer.Option("--labelled-masks", help="Give the labelled mask in place of the estimated one.")
    ] = False,
    align_to: AlignTo = "box",
    category: LabelCategory = None,
    split: SpreadSplit = "all",
    limit: Annotated[int | None, typer.Option("--limit", min=1, help="At most so many a category.")] = None,
    report: OutlineReport = None,
    csv: Csv = None,
    estimator: Estimator = "embedded",
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    renderer: RendererName = "raster",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """How well models lie on their objects: rotation, silhouette, outline, box, before and after refinement.

    Exit code 1: a photo failed; the others were evaluated.
    """
    if gallery is not None and cad != "chosen":
        raise typer.BadParameter("--gallery belongs to --cad chosen")
    from cadpose.alignment.placement import Placement
    from cadpose.alignment.refinement.refine import MODES
    from cadpose.datasets.gallery import read_gallery
    from cadpose.errors import InputError
    from cadpose.evaluation.alignment import Ways, evaluate_alignment
    from cadpose.evaluation.alignment_report import write_alignment_report
    from cadpose.evaluation.alignment_tables import alignment_tables
    from cadpose.evaluation.outline_report import report_files
    from cadpose.evaluation.retrieval_inputs import choose_labels, gallery_candidates, is_synthetic

    labels = choose_labels(dataset, category, split, limit, kind)
    own = [] if report is None else [("--report", path) for path in report_files(report)]
    check_targets([("--csv", csv)], own, [dataset, *(label.photo for label in labels)])
    annotator = make_annotator(
        library,
        device=device,
        seed=seed,
        candidates=candidates,
        renderer=renderer,
        estimator=estimator,
        masks=masks,
    )
    modes = list(dict.fromkeys(refine or MODES))
    named = None if gallery is None else gallery_candidates(annotator.library, read_gallery(gallery))
    placements = {m: Placement(annotator.renderer, align_to, annotator.refiner(m), m) for m in modes}
    ways = Ways(placements, cad == "chosen", rotation == "true", labelled_masks, named)
    with progress_bar("alignment", len(labels)) as bar:
        outcomes, failed = evaluate_alignment(labels, annotator, ways, lambda: bar.advance(bar.tasks[0].id))
    name_unused(failed)
    if not outcomes:
        raise InputError(f"{dataset}: no object could be placed")
    compared = sum(outcome.labelled_mask for outcome in outcomes)
    tables = alignment_tables(
        outcomes,
        dataset=str(dataset),
        synthetic=is_synthetic(labels, str(dataset)),
        facts={
            "CAD model": "as labelled" if cad == "true" else "chosen by the ranking",
            "Start": "labelled rotation" if rotation == "true" else f"estimated ({annotator.rotation.name})",
            "Masks given": "labelled where they are" if labelled_masks else annotator.masks.name,
            "Silhouettes compared with": f"{compared} labelled masks, {len(outcomes) - compared} estimated",
            "Focal length fitted to": align_to,
        },
        notes=(f"{len(failed)} photos could not be used.",) if failed else (),
    )
    write_csv(csv, tables)
    page = None if report is None else write_alignment_report(report, tables, outcomes)
    print_tables(tables, json, page)
    if failed:
        raise typer.Exit(1)
