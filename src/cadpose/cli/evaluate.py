"""``cadpose evaluate``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from cadpose.cli.evaluate_alignment import alignment
from cadpose.cli.evaluate_detection import detection
from cadpose.cli.evaluate_masks import masks
from cadpose.cli.evaluated import LabelCategory, name_unused
from cadpose.cli.library_search import library_search
from cadpose.cli.options import (
    Candidates,
    DetectorName,
    Device,
    Estimator,
    Json,
    LibraryFolder,
    RendererName,
    Seed,
    make_annotator,
)
from cadpose.cli.output import print_json, print_table, progress_bar
from cadpose.cli.retrieval import Boxes, retrieval

if TYPE_CHECKING:
    from cadpose.datasets.label import Label
    from cadpose.evaluation.rotation import RotationResult
    from cadpose.geometry.boxes import Box
    from cadpose.pipeline import Annotator
    from cadpose.records import Photo

app = typer.Typer(help="Tables over labelled photographs.", no_args_is_help=True)
app.command("retrieval")(retrieval)
app.command("library")(library_search)
app.command("alignment")(alignment)
app.command("detection")(detection)
app.command("masks")(masks)

_Labels = Annotated[Path, typer.Argument(help="Label file, JSON or JSONL: photo, box, category, azimuth ...")]
_Split = Annotated[str | None, typer.Option("--split", help="Only labels of this split.")]


@app.command("rotation")
def rotation(
    labels: _Labels,
    category: LabelCategory = None,
    split: _Split = None,
    unoccluded: Annotated[
        bool, typer.Option("--unoccluded", help="Only labels that are neither occluded nor truncated.")
    ] = False,
    report: Annotated[
        Path | None, typer.Option("--report", help="Folder of a page with diagrams and the worst photos.")
    ] = None,
    jitter: Annotated[
        float, typer.Option("--jitter", min=0, max=0.49, help="Move the boxes' sides by up to this share.")
    ] = 0,
    shrink: Annotated[
        int | None, typer.Option("--shrink", min=1, help="Leave so many pixels of the boxes' longer sides.")
    ] = None,
    turn: Annotated[
        float, typer.Option("--turn", min=0, max=180, help="Turn the photos by up to so many degrees.")
    ] = 0,
    symmetry: Annotated[
        Literal["none", "cad", "category"],
        typer.Option(
            "--symmetry", help="Forgive turns that look alike: by the labelled model, or also by category."
        ),
    ] = "cad",
    pool: Annotated[
        Literal["usual", "with-true", "without-true"],
        typer.Option("--pool", help="Whether the labelled CAD model is among those that vote."),
    ] = "usual",
    boxes: Boxes = "true",
    detector: DetectorName = "embedded",
    estimator: Estimator = "embedded",
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    renderer: RendererName = "raster",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Acc@30, Acc@10, median error and azimuth flips of the estimated rotation.

    Exit code 1: a photo failed; the others were evaluated.
    """
    from cadpose.datasets.labels import only_unoccluded, read_labels
    from cadpose.errors import CadposeError
    from cadpose.evaluation.confidence import confidence_figures
    from cadpose.evaluation.perturbations import Perturbation
    from cadpose.evaluation.pool import label_pool
    from cadpose.evaluation.report import prepare_report
    from cadpose.evaluation.retrieval_inputs import boxes_in_photos, detected_box
    from cadpose.evaluation.rotation import evaluate_rotation, rotation_table
    from cadpose.evaluation.symmetry import label_symmetry

    try:
        perturbation = Perturbation(jitter, shrink, turn, seed)
    except ValueError as error:  # not a number is in no range, but passes typer's
        raise typer.BadParameter(str(error)) from None
    if boxes == "detected" and jitter:
        raise typer.BadParameter("--jitter moves labelled boxes: leave it out with --boxes detected")

    wanted = read_labels(labels, category, split)
    if unoccluded:
        wanted = only_unoccluded(wanted, labels)
    if report is not None:
        # Before the long part, so that nothing is evaluated in vain.
        prepare_report(report, [labels, *(label.photo for label in wanted)])
    annotator = make_annotator(
        library,
        device=device,
        seed=seed,
        candidates=candidates,
        renderer=renderer,
        estimator=estimator,
        detector=detector,
    )
    seen = boxes_in_photos(perturbation, None if boxes == "true" else detected_box(annotator))
    voters = label_pool(annotator.library, pool, candidates)
    with progress_bar("rotation", len(wanted)) as bar:
        results = evaluate_rotation(
            perturbation.turned_labels(wanted),
            lambda label: annotator.estimate_rotation(*seen(label), label.category, voters(label)),
            CadposeError,
            lambda _: bar.advance(bar.tasks[0].id),
            label_symmetry(annotator.library, symmetry),
        )
    name_unused((str(r.label.photo), r.reason) for r in results if r.reason and not r.lost)
    table = rotation_table(results) | confidence_figures(results)
    if report is not None:
        facts = {
            "Labels": str(labels),
            "Boxes": "as labelled" if boxes == "true" else f"detected ({annotator.detector.name})",
            "Perturbation": perturbation.in_words(),
        }
        _write_report(report, annotator, results, table, seen, facts)
    if json:
        print_json(table)
    else:
        rows = [
            [
                name,
                str(row["n"]),
                f"{row['yield']:.0%}",
                _share(row, "acc30"),
                _share(row, "acc10"),
                _degrees(row["mederr"]),
                _share(row, "flips"),
                *([str(row["lost"]), _share(row, "acc30_all")] if boxes == "detected" else []),
            ]
            for name, row in _rows(table)
        ]
        if macro := table["macro"]:
            rows.append(
                [
                    "macro mean",
                    "",
                    "",
                    _share(macro, "acc30"),
                    _share(macro, "acc10"),
                    _degrees(macro["mederr"]),
                    _share(macro, "flips"),
                    *(["", ""] if boxes == "detected" else []),
                ]
            )
        columns = ["category", "photos", "yield", "Acc@30 [95 %]", "Acc@10", "MedErr", "flips"]
        columns += ["not found", "Acc@30 of all [95 %]"] if boxes == "detected" else []
        print_table("Rotation", columns, rows)
        if table["symmetric"]:
            typer.echo(f"Photos scored modulo the object's symmetry: {table['symmetric']} of {table['n']}")
        _print_confidence(table)
        if report is not None:
            typer.echo(f"Report: {report / 'report.html'}")
        _print_lost(results)
    if any(r.reason and not r.lost for r in results):
        raise typer.Exit(1)


def _print_lost(results: Sequence[RotationResult]) -> None:
    """Why the detector lost photos, the most frequent reason first."""
    reasons = Counter(r.reason for r in results if r.lost)
    if reasons:
        told = "; ".join(f"{reason} ({n})" for reason, n in reasons.most_common(8))
        typer.echo(f"Not found by the detector: {told}")


def _print_confidence(table: dict[str, Any]) -> None:
    if table["ece"] is None:
        return
    typer.echo(f"Best of five hypotheses: Acc@30 {table['acc30_top5']:.1%}")
    kind = "" if table["calibrated"] else " (shares, not calibrated)"
    typer.echo(f"Probabilities{kind}: ECE {table['ece']:.3f}, Brier score {table['brier']:.3f}")
    if table["calibrated"] and table["precision_unflagged"] is not None:
        kept, right = f"{table['coverage_unflagged']:.0%}", f"{table['precision_unflagged']:.1%}"
        typer.echo(f"Not flagged for review: {kept}, {right} of them within 30°")


def _write_report(
    folder: Path,
    annotator: Annotator,
    results: Sequence[RotationResult],
    table: dict[str, Any],
    seen: Callable[[Label], tuple[Photo, Box]],
    facts: dict[str, str],
) -> None:
    from cadpose.evaluation.report import write_report
    from cadpose.evaluation.worst import compare, worst_results

    chosen = worst_results(results)
    drawn = []
    with progress_bar("report", len(chosen)) as bar:
        for result in chosen:
            drawn.append(compare(annotator, result, seen))
            bar.advance(bar.tasks[0].id)
    facts |= {
        "Estimator": annotator.rotation.name,
        "Library": annotator.library.digest,
        "Scored modulo symmetry": f"{table['symmetric']} of {table['n']} photos",
    }
    write_report(folder, results, table, [one for one in drawn if one is not None], facts)


def _rows(table: dict[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    return [*table["classes"].items(), ("all", table)]


def _share(row: dict[str, Any], key: str) -> str:
    """A fraction of 1 in per cent, with its interval if it has one; a dash where no photo answered."""
    if row[key] is None:
        return "-"
    interval = row.get(f"{key}_interval")
    return f"{row[key]:.1%}" + (f" [{interval[0]:.1%}, {interval[1]:.1%}]" if interval else "")


def _degrees(value: float | None) -> str:
    return "-" if value is None else f"{value:.1f}°"
