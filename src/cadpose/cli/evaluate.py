"""``cadpose evaluate``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from cadpose.cli.options import (
    Candidates,
    Device,
    Json,
    LibraryFolder,
    RendererName,
    Seed,
    Similarity,
    make_annotator,
)
from cadpose.cli.output import complain, print_json, print_table, progress_bar

app = typer.Typer(help="Tables over labelled photographs.", no_args_is_help=True)

_Labels = Annotated[Path, typer.Argument(help="Label file, JSON or JSONL: photo, box, category, azimuth ...")]
_Category = Annotated[str | None, typer.Option("--category", help="Only labels of this category.")]
_Split = Annotated[str | None, typer.Option("--split", help="Only labels of this split.")]


@app.command("rotation")
def rotation(
    labels: _Labels,
    category: _Category = None,
    split: _Split = None,
    unoccluded: Annotated[
        bool, typer.Option("--unoccluded", help="Only labels that are neither occluded nor truncated.")
    ] = False,
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
    from cadpose.datasets.labels import object_in_photo, only_unoccluded, read_labels
    from cadpose.errors import CadposeError
    from cadpose.evaluation.rotation import evaluate_rotation, rotation_table

    wanted = read_labels(labels, category, split)
    if unoccluded:
        wanted = only_unoccluded(wanted, labels)
    annotator = make_annotator(library, device=device, seed=seed, candidates=candidates, renderer=renderer)
    with progress_bar("rotation", len(wanted)) as bar:
        results = evaluate_rotation(
            wanted,
            lambda label: annotator.estimate_rotation(*object_in_photo(label), label.category),
            CadposeError,
            lambda _: bar.advance(bar.tasks[0].id),
        )
    _report_failures([(str(r.label.photo), r.reason) for r in results if r.reason])
    table = rotation_table(results)
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
                ]
            )
        columns = ["category", "photos", "yield", "Acc@30 [95 %]", "Acc@10", "MedErr", "flips"]
        print_table("Rotation", columns, rows)
    _exit(table)


@app.command("retrieval")
def retrieval(
    labels: _Labels,
    gallery: Annotated[
        Path | None, typer.Option("--gallery", help="JSON array of CAD ids to choose among.")
    ] = None,
    rotation_from: Annotated[
        Literal["true", "estimated"],
        typer.Option("--rotation", help="Compare at the labelled or at the estimated rotation."),
    ] = "estimated",
    category: _Category = None,
    split: _Split = None,
    library: LibraryFolder = None,
    candidates: Candidates = 10,
    similarity: Similarity = "aligned",
    renderer: RendererName = "raster",
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """How often the true CAD model is ranked first, among the first two and three.

    Exit code 1: a photo failed; the others were evaluated.
    """
    from cadpose.datasets.labels import read_gallery, read_labels
    from cadpose.errors import CadposeError, InputError
    from cadpose.evaluation.retrieval import evaluate_retrieval, retrieval_ranking, retrieval_table

    wanted = [label for label in read_labels(labels, category, split) if label.cad is not None]
    if not wanted:
        raise InputError(f"{labels}: no label names its cad")
    annotator = make_annotator(
        library,
        device=device,
        seed=seed,
        candidates=candidates,
        similarity=similarity,
        renderer=renderer,
    )
    rank = retrieval_ranking(annotator, None if gallery is None else read_gallery(gallery), rotation_from)
    with progress_bar("retrieval", len(wanted)) as bar:
        results = evaluate_retrieval(wanted, rank, CadposeError, lambda _: bar.advance(bar.tasks[0].id))
    _report_failures([(str(r.label.photo), r.reason) for r in results if r.reason])
    table = retrieval_table(results)
    if json:
        print_json(table)
    else:
        places = ("top1", "top2", "top3")
        rows = [[name, str(row["n"]), *(_share(row, k) for k in places)] for name, row in _rows(table)]
        if macro := table["macro"]:
            rows.append(["macro mean", "", *(_share(macro, k) for k in places)])
        print_table("CAD retrieval", ["category", "photos", "top-1 [95 %]", "top-2", "top-3"], rows)
    _exit(table)


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


def _exit(table: dict[str, Any]) -> None:
    if table["yield"] < 1.0:
        raise typer.Exit(1)


def _report_failures(failures: Sequence[tuple[str, str]]) -> None:
    for photo, reason in failures:
        complain(reason if photo in reason else f"{photo}: {reason}")
