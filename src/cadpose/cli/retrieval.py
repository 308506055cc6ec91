"""``cadpose evaluate retrieval``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cadpose.cli.evaluated import Csv, LabelCategory, SpreadSplit, name_unused, print_tables, write_csv
from cadpose.cli.options import (
    Candidates,
    DetectorName,
    Device,
    Json,
    LibraryFolder,
    RendererName,
    Seed,
    make_annotator,
)
from cadpose.cli.output import complain, progress_bar
from cadpose.cli.targets import check_targets

if TYPE_CHECKING:
    from cadpose.evaluation.retrieval import Outcome
    from cadpose.evaluation.retrieval_job import Progress
    from cadpose.evaluation.retrieval_tables import RetrievalTables
    from cadpose.pipeline import Annotator


def _known_measures(names: list[str] | None) -> list[str] | None:
    from cadpose.evaluation.contest import ALL, known_names

    known = (*known_names(), ALL)
    for name in names or ():
        if name not in known:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(known)}")
    return names


Measures = Annotated[
    list[str] | None,
    typer.Option(
        "--measure",
        callback=_known_measures,
        help="What ranks: aligned (unless told), fused, sm1, sm2 ..., or all; repeatable.",
    ),
]
Boxes = Annotated[
    Literal["true", "detected"],
    typer.Option("--boxes", help="Take the labelled boxes, or those of the detector."),
]
RotationFrom = Annotated[
    str,
    typer.Option("--rotation", help="true: as labelled; predicted: by the estimator; or a label FILE."),
]
RejectFlagged = Annotated[
    bool, typer.Option("--reject-flagged", help="Reject photos whose predicted rotation needs review.")
]
Accept = Annotated[
    float,
    typer.Option("--accept", min=0, max=1, help="Accept first candidates from this probability, if stated."),
]
Report = Annotated[
    Path | None, typer.Option("--report", help="HTML file with tables, diagrams and examples.")
]
Resume = Annotated[bool, typer.Option("--resume", help="Go on with the same evaluation in --out.")]


def retrieval(
    dataset: Annotated[
        Path, typer.Argument(help="Label file, JSON or JSONL: photo, category, cad, box, azimuth ...")
    ],
    gallery: Annotated[
        Path | None,
        typer.Option("--gallery", help="JSON array of CAD ids to choose among, or arrays by category."),
    ] = None,
    measure: Measures = None,
    rotation: RotationFrom = "predicted",
    boxes: Boxes = "true",
    detector: DetectorName = "embedded",
    reject_flagged: RejectFlagged = False,
    category: LabelCategory = None,
    split: SpreadSplit = "all",
    limit: Annotated[
        int | None, typer.Option("--limit", min=1, help="At most so many photos a category, evenly spread.")
    ] = None,
    accept: Accept = 0.9,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Folder for every outcome and the tables.")
    ] = None,
    resume: Resume = False,
    report: Report = None,
    csv: Csv = None,
    beside_paper: Annotated[
        bool, typer.Option("--beside-paper", help="Show the paper's own tables too.")
    ] = False,
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    renderer: RendererName = "raster",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """How often the true CAD model is ranked first, second, third: the paper's Tables 1 to 4.

    Exit code 1: a photo could not be used; the others were evaluated.
    """
    from cadpose.evaluation.figures import require_matplotlib
    from cadpose.evaluation.retrieval_inputs import choose_labels
    from cadpose.evaluation.retrieval_job import TABLE_FILES, RetrievalJob, run_job
    from cadpose.evaluation.retrieval_store import OUTCOMES, SETTINGS

    if resume and out is None:
        raise typer.BadParameter("--resume needs --out, the folder to go on with")
    flagged_are_predicted(reject_flagged, rotation)
    of_file = rotation not in ("true", "predicted")
    if of_file and not Path(rotation).is_file():
        raise typer.BadParameter(
            f"--rotation is true, predicted or a label file, and there is no file {rotation}"
        )
    # Before the long part, so that nothing is evaluated in vain.
    labels = choose_labels(dataset, category, split, limit)
    inputs = [dataset, *(label.photo for label in labels), *([gallery] if gallery else [])]
    inputs += [label.mask for label in labels if isinstance(label.mask, Path)]
    inputs += [Path(rotation)] if of_file else []
    own = [] if out is None else [out, *(out / name for name in (SETTINGS, OUTCOMES, *TABLE_FILES))]
    check_targets([("--report", report), ("--csv", csv)], [("--out", path) for path in own], inputs)
    if report is not None:
        require_matplotlib()
    job = RetrievalJob(
        dataset, gallery, tuple(measure or ("aligned",)), rotation, boxes, reject_flagged, category, split,
        limit, accept, device, seed,
    )  # fmt: skip
    annotator = make_annotator(
        library,
        device=device,
        seed=seed,
        # What the docs tell of the measures was measured with these.
        masks="grabcut",
        candidates=candidates,
        renderer=renderer,
        detector=detector,
    )
    with photo_progress("retrieval") as progress:
        tables, outcomes = run_job(
            job, annotator, out, resume=resume, beside_paper=beside_paper, progress=progress
        )
    write_csv(csv, tables)
    tell(tables, outcomes, annotator, report, json)


def flagged_are_predicted(reject_flagged: bool, rotation: str) -> None:
    """Only what the estimator predicts is flagged.

    Raises:
        BadParameter: flagged rotations of another origin shall be rejected.
    """
    if reject_flagged and rotation != "predicted":
        raise typer.BadParameter("--reject-flagged needs --rotation predicted: no other rotation is flagged")


@contextmanager
def photo_progress(what: str) -> Iterator[Progress]:
    """A bar that learns the number of photos on its way."""
    from cadpose.evaluation.retrieval_job import Progress

    with progress_bar(what, None) as bar:
        task = bar.tasks[0].id
        advance: Callable[[], None] = lambda: bar.advance(task)  # noqa: E731
        yield Progress(lambda photos: bar.update(task, total=photos), advance, complain)


def tell(
    tables: RetrievalTables,
    outcomes: Sequence[Outcome],
    annotator: Annotator,
    report: Path | None,
    json: bool,
) -> None:
    """Print the tables, write the report, name the photos that could not be used."""
    from cadpose.evaluation.retrieval import failures
    from cadpose.evaluation.retrieval_report import draw_examples, write_retrieval_report

    broken = failures(outcomes)
    name_unused(broken)
    if report is not None:
        names = [table.measure for table in tables.tables]
        with progress_bar("report", len(names)) as bar:
            strips = draw_examples(annotator, outcomes, names, lambda: bar.advance(bar.tasks[0].id))
        facts = {"Estimator": annotator.rotation.name, "Library": annotator.library.digest}
        write_retrieval_report(report, tables, strips, facts)
    print_tables(tables, json, report)
    if broken:
        raise typer.Exit(1)
