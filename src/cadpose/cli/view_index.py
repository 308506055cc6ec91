"""``cadpose library index``, and how other verbs name an index."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cadpose.cli.options import Categories, Device, Json, LibraryFolder
from cadpose.cli.output import complain, print_json, progress_bar

if TYPE_CHECKING:
    from cadpose.similarity.index.drawn import DrawnRanking
    from cadpose.similarity.index.library_index import LibraryIndex

IndexFolder = Annotated[
    Path | None,
    typer.Option("--index", help="Folder of the view index; view-index in the library unless told."),
]
Embedding = Annotated[
    Path | None,
    typer.Option("--embedding", help="ONNX file that embeds views; $CADPOSE_EMBEDDING or the shipped one."),
]


Draw = Annotated[
    int,
    typer.Option(
        "--draw", min=0, help="Draw the best so many at the rotation, where it is known, and rank them again."
    ),
]


def open_drawn(library: Path | None, device: str) -> DrawnRanking:
    """What draws the best that an index finds."""
    from cadpose.backends import encoder_on
    from cadpose.library.catalogue import Library
    from cadpose.similarity.index.drawn import DrawnRanking

    encoder_on(device)  # refuses a device that is not there
    catalogue = Library.open(library)
    catalogue.cache_size = 128
    return DrawnRanking(catalogue, os.cpu_count() or 1, device)


def open_index(library: Path | None, index: Path | None, embedding: Path | None, device: str) -> LibraryIndex:
    """The index that the options name."""
    from cadpose.backends import encoder_on
    from cadpose.library.catalogue import Library
    from cadpose.similarity.embedding import ViewEmbedder, embedding_network
    from cadpose.similarity.index.library_index import LibraryIndex, index_folder

    encoder_on(device)  # refuses a device that is not there
    folder = index or index_folder(Library.open(library))
    return LibraryIndex.open(folder, ViewEmbedder(embedding_network(embedding), device), device)


def index(
    category: Categories = None,
    azimuths: Annotated[
        int, typer.Option("--azimuths", min=1, max=72, help="Views around a model, evenly spaced.")
    ] = 8,
    elevation: Annotated[
        list[float] | None,
        typer.Option(
            "--elevation", min=-90, max=90, help="Views from this height, degrees; 0, 15, 35 unless told."
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Threads; one a core unless told.")
    ] = None,
    embedding: Embedding = None,
    index: IndexFolder = None,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
) -> None:
    """Make the library's view index, or bring it up to date: only new and changed models are drawn.

    It may be ended at any moment; the next run goes on.
    """
    from cadpose.backends import encoder_on
    from cadpose.library.catalogue import Library
    from cadpose.similarity.embedding import ViewEmbedder, embedding_network
    from cadpose.similarity.index.build import LibrarySource, build_index
    from cadpose.similarity.index.describe import ViewDescriber
    from cadpose.similarity.index.grid import ViewGrid
    from cadpose.similarity.index.library_index import index_folder

    encoder_on(device)  # refuses a device that is not there
    catalogue = Library.open(library)
    for name in category or ():
        catalogue.representatives(name, 1)  # says which categories there are
    usual = ViewGrid()
    try:
        grid = ViewGrid(azimuths, tuple(sorted(set(elevation))) if elevation else usual.elevations)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    # One thread each: models are shared out among threads.
    embedder = ViewEmbedder(embedding_network(embedding), device, threads=1)
    folder = index or index_folder(catalogue)
    with progress_bar("index", None) as bar:
        report = build_index(
            folder,
            LibrarySource(catalogue),
            ViewDescriber(embedder, grid, device),
            categories=category,
            workers=workers or os.cpu_count() or 1,
            progress=lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total),
        )
    for cad_id, reason in report.failed:
        complain(f"{cad_id} left out: {reason}")
    if json:
        print_json({**dataclasses.asdict(report), "index": str(folder)})
    else:
        typer.echo(
            f"{len(report.added)} added, {len(report.removed)} removed, {report.unchanged} unchanged, "
            f"{len(report.failed)} failed; {report.models} models, {report.nbytes / 1e6:.1f} MB: {folder}"
        )
    if report.failed and not report.models:
        raise typer.Exit(1)
