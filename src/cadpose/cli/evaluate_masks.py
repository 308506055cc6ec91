"""``cadpose evaluate masks``."""

from __future__ import annotations

from typing import Annotated

import typer

from cadpose.cli.evaluate_detection import Dataset, Images, Limit, Smallest, read_files
from cadpose.cli.evaluated import Csv, OutlineReport, name_unused, print_tables, write_csv
from cadpose.cli.options import Categories, Device, Json, Seed
from cadpose.cli.output import progress_bar
from cadpose.cli.targets import check_targets


def _known_masks(names: list[str] | None) -> list[str] | None:
    from cadpose.backends import MASKS

    for name in names or ():
        if name not in MASKS:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(MASKS)}")
    return names


def masks(
    dataset: Dataset,
    images: Images = None,
    masks: Annotated[
        list[str] | None,
        typer.Option(
            "--masks",
            callback=_known_masks,
            help="What finds the pixels in a box: network (unless told), grabcut, none; repeatable.",
        ),
    ] = None,
    category: Categories = None,
    smallest: Smallest = 1024,
    jitter: Annotated[
        float, typer.Option("--jitter", min=0, max=0.49, help="Move the boxes' sides by up to this share.")
    ] = 0,
    limit: Limit = None,
    report: OutlineReport = None,
    csv: Csv = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """How well masks in true boxes agree with true masks, the methods side by side.

    Exit code 1: a photo could not be used; the others were evaluated.
    """
    from cadpose.backends import make_masks
    from cadpose.datasets.scene_sets import open_scenes
    from cadpose.errors import InputError
    from cadpose.evaluation.mask_report import write_mask_report
    from cadpose.evaluation.mask_tables import mask_tables
    from cadpose.evaluation.masks import evaluate_masks
    from cadpose.evaluation.outline_report import report_files
    from cadpose.evaluation.perturbations import Perturbation
    from cadpose.evaluation.scene_choice import evenly_spread

    try:
        perturbation = Perturbation(jitter, seed=seed)
    except ValueError as error:  # not a number is in no range, but passes typer's
        raise typer.BadParameter(str(error)) from None
    scenes = open_scenes(dataset, images)
    own = [] if report is None else [("--report", path) for path in report_files(report)]
    check_targets([("--csv", csv)], own, read_files(dataset, scenes))
    estimators = {name: make_masks(name, device, seed) for name in dict.fromkeys(masks or ["network"])}
    chosen = evenly_spread(scenes.scenes, limit)
    with progress_bar("masks", len(chosen)) as bar:
        outcomes, failed = evaluate_masks(
            chosen,
            estimators,
            scenes.categories if category is None else category,
            smallest=smallest,
            perturbation=perturbation if jitter else None,
            on_done=lambda: bar.advance(bar.tasks[0].id),
        )
    name_unused(failed)
    if not outcomes:
        raise InputError(f"{dataset}: holds no object with a mask that could be compared")
    words = perturbation.in_words()
    tables = mask_tables(
        outcomes,
        dataset=scenes.name,
        synthetic=scenes.synthetic,
        boxes=f"as labelled, {words}" if words else "as labelled",
        notes=(f"{len(failed)} photos could not be used.",) if failed else (),
    )
    write_csv(csv, tables)
    page = None if report is None else write_mask_report(report, tables, outcomes, {"Device": device})
    print_tables(tables, json, page)
    if failed:
        raise typer.Exit(1)
