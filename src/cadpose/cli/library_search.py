"""``cadpose evaluate library``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cadpose.cli.options import Categories, Device, Json, LibraryFolder, Seed, make_annotator
from cadpose.cli.output import complain, print_json, print_table, progress_bar
from cadpose.cli.view_index import Draw, Embedding, IndexFolder, open_drawn, open_index

if TYPE_CHECKING:
    from collections.abc import Sequence

    from cadpose.datasets.labels import Label
    from cadpose.geometry.boxes import Box
    from cadpose.records import Photo, Rotation


def library_search(
    dataset: Annotated[Path, typer.Argument(help="Label file, JSON or JSONL: photo, category, cad, box ...")],
    category: Categories = None,
    limit: Annotated[
        int | None, typer.Option("--limit", min=1, help="At most so many photos a category, evenly spread.")
    ] = None,
    rotation: Annotated[
        Literal["predicted", "true", "none"],
        typer.Option("--rotation", help="Views near the predicted or the true rotation, or all of them."),
    ] = "predicted",
    rerank: Annotated[
        bool, typer.Option("--rerank/--no-rerank", help="Rank what is found by its small maps too.")
    ] = True,
    draw: Draw = 10,
    embedding: Embedding = None,
    index: IndexFolder = None,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Retrieval among all models of a category: top-1, top-3, top-10, and how alike the answer is.

    Exit code 1: a photo could not be used; the others were evaluated.
    """
    from cadpose.errors import InputError
    from cadpose.evaluation.library_search import labelled_rotation, search_labels, search_table
    from cadpose.evaluation.retrieval_inputs import choose_labels
    from cadpose.evaluation.shape_similarity import THRESHOLD, Shapes
    from cadpose.library.catalogue import Library
    from cadpose.library.class_map import category_from_name

    everything = choose_labels(dataset, limit=limit)
    labels = everything
    if category:
        labels = [one for one in everything if (category_from_name(one.category) or one.category) in category]
    if not labels:
        raise InputError(
            f"{dataset}: no label of category {', '.join(category or ())}; it has "
            f"{', '.join(sorted({one.category for one in everything}))}"
        )
    opened = open_index(library, index, embedding, device)
    catalogue = Library.open(library)
    catalogue.cache_size = 256
    by_category: dict[str, list[str]] = {}
    for entry in opened.entries:
        by_category.setdefault(entry.category, []).append(entry.id)
    annotator = make_annotator(library, device=device, seed=seed) if rotation == "predicted" else None

    def rotations(label: Label, photo: Photo, box: Box) -> Sequence[Rotation]:
        if annotator is not None:
            return opened.likely_rotations(annotator.estimate_rotation(photo, box, label.category))
        return labelled_rotation(label, photo, box) if rotation == "true" else []

    with progress_bar("search", len(labels)) as bar:
        outcomes = search_labels(
            labels,
            opened,
            lambda name: by_category.get(name, []),
            Shapes(catalogue, seed),
            rotations,
            rerank=rerank,
            drawn=open_drawn(library, device) if draw else None,
            draw=draw,
            seed=seed,
            done=lambda: bar.advance(bar.tasks[0].id),
        )
    for outcome in outcomes:
        if outcome.reason:
            complain(f"{outcome.label.photo} left out: {outcome.reason}")
    table = search_table(outcomes)
    if json:
        print_json({**table, "fscore_threshold": THRESHOLD})
    else:
        rows = [*table["categories"].items(), *([("all", table["all"])] if table["all"] else [])]
        print_table(
            f"Among all models of the category; F-score at {THRESHOLD:g} diagonals; by chance in brackets",
            ["category", "photos", "models", "top-1", "top-3", "top-10", "F-score", "Chamfer"],
            [
                [
                    name,
                    str(row["photos"]),
                    f"{row['models']:.0f}",
                    *(f"{row[k]:.0%} ({row['chance'][k]:.0%})" for k in ("top1", "top3", "top10")),
                    f"{row['fscore']:.2f} ({row['chance_fscore']:.2f})",
                    f"{row['chamfer']:.4f} ({row['chance_chamfer']:.4f})",
                ]
                for name, row in rows
            ],
        )
    if table["rejected"]:
        raise typer.Exit(1)
