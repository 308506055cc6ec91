"""``cadpose evaluate detection``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cadpose.cli.evaluated import Csv, name_unused, print_tables, write_csv
from cadpose.cli.options import Categories, DetectorNames, Device, Json, Seed
from cadpose.cli.output import progress_bar
from cadpose.cli.targets import check_targets

if TYPE_CHECKING:
    from cadpose.datasets.scenes import SceneSet

Dataset = Annotated[
    Path,
    typer.Argument(
        help="COCO JSON; a label file; or a folder: YOLO's images and labels, Pix3D, `cadpose synth`."
    ),
]
Images = Annotated[
    Path | None,
    typer.Option("--images", help="Folder of a COCO file's photos; that of the file unless told."),
]
Smallest = Annotated[
    float, typer.Option("--smallest", min=0, help="Leave aside objects of fewer pixels than this (area).")
]
Limit = Annotated[
    int | None,
    typer.Option("--limit", min=1, help="At most so many photos, evenly spread over the data set."),
]


def detection(
    dataset: Dataset,
    images: Images = None,
    detector: DetectorNames = None,
    category: Categories = None,
    smallest: Smallest = 1024,
    floor: Annotated[
        float, typer.Option("--floor", min=0, max=1, help="Lowest score that counts for average precision.")
    ] = 0.05,
    masks: Annotated[
        Literal["own", "grabcut", "network", "none"],
        typer.Option("--masks", help="Masks of detections without one: own leaves them without."),
    ] = "own",
    limit: Limit = None,
    report: Annotated[
        Path | None, typer.Option("--report", help="Folder of a page, tables, outcomes and sheets of photos.")
    ] = None,
    csv: Csv = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Average precision, recall, precision and time of detectors, side by side.

    Exit code 1: a photo could not be used; the others were evaluated.
    """
    from cadpose.backends import make_detector, make_masks
    from cadpose.datasets.scene_sets import open_scenes
    from cadpose.evaluation.coco_metrics import require_pycocotools
    from cadpose.evaluation.detection_report import report_files, write_detection_report
    from cadpose.evaluation.detection_run import Contestant, counted_categories, evaluate_detection
    from cadpose.evaluation.detection_tables import detection_tables
    from cadpose.evaluation.scene_choice import evenly_spread

    require_pycocotools()
    names = detector or ["embedded"]
    scenes = open_scenes(dataset, images)
    own = [] if report is None else [("--report", path) for path in report_files(report, names)]
    check_targets([("--csv", csv)], own, read_files(dataset, scenes))
    categories = counted_categories(scenes, category)
    made = None if masks == "own" else make_masks(masks, device, seed)
    # What detectors find is not narrowed: who looks for bags alone takes other things for bags.
    contestants = [Contestant(name, make_detector(name, None, device), floor, made) for name in names]
    chosen = evenly_spread(scenes.scenes, limit)
    with progress_bar("detection", len(chosen)) as bar:
        outcomes, failed = evaluate_detection(
            chosen, contestants, categories, lambda: bar.advance(bar.tasks[0].id)
        )
    name_unused(failed)
    tables = detection_tables(
        outcomes,
        contestants,
        categories,
        dataset=scenes.name,
        synthetic=scenes.synthetic,
        smallest=smallest,
        notes=(f"{len(failed)} photos could not be used.",) if failed else (),
    )
    write_csv(csv, tables)
    page = None
    if report is not None:
        with progress_bar("report", len(names)) as bar:
            page = write_detection_report(
                report, tables, outcomes, {"Device": device}, lambda: bar.advance(bar.tasks[0].id)
            )
    print_tables(tables, json, page)
    if failed:
        raise typer.Exit(1)


def read_files(dataset: Path, scenes: SceneSet) -> list[Path]:
    """What an evaluation reads and may not write over."""
    return [*([dataset] if dataset.is_file() else []), *(scene.photo for scene in scenes.scenes)]
