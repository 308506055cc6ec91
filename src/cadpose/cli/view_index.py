"""``cadpose library index`` and ``cadpose library search``."""

from __future__ import annotations

import dataclasses
import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cadpose.cli.options import Categories, Device, Json, LibraryFolder, Seed, make_annotator
from cadpose.cli.output import complain, print_json, print_table, progress_bar

if TYPE_CHECKING:
    from cadpose.similarity.index.library_index import LibraryIndex

IndexFolder = Annotated[
    Path | None,
    typer.Option("--index", help="Folder of the view index; view-index in the library unless told."),
]
Embedding = Annotated[
    Path | None,
    typer.Option("--embedding", help="ONNX file that embeds views; $CADPOSE_EMBEDDING or the shipped one."),
]


def open_index(library: Path | None, index: Path | None, embedding: Path | None, device: str) -> LibraryIndex:
    """The index that the options name."""
    from cadpose.library.catalogue import Library
    from cadpose.similarity.embedding import ViewEmbedder, embedding_network
    from cadpose.similarity.index.library_index import LibraryIndex, index_folder

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
    from cadpose.library.catalogue import Library
    from cadpose.similarity.embedding import ViewEmbedder, embedding_network
    from cadpose.similarity.index.build import LibrarySource, build_index
    from cadpose.similarity.index.describe import ViewDescriber
    from cadpose.similarity.index.grid import ViewGrid
    from cadpose.similarity.index.library_index import index_folder

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


def search(
    photo: Annotated[Path, typer.Argument(help="Photograph.")],
    box: Annotated[str, typer.Option("--box", help="x0,y0,x1,y1 of the object in pixels.")],
    category: Annotated[
        str | None, typer.Option("--category", help="Only models of this library category.")
    ] = None,
    rotation: Annotated[
        str | None,
        typer.Option(
            "--rotation",
            help="azimuth,elevation[,inplane] in degrees; with --category it is estimated, without it all "
            "views take part.",
        ),
    ] = None,
    top: Annotated[int, typer.Option("--top", min=1, max=10_000, help="Models to find.")] = 50,
    rerank: Annotated[
        bool, typer.Option("--rerank/--no-rerank", help="Rank them by their small maps too.")
    ] = True,
    embedding: Embedding = None,
    index: IndexFolder = None,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """The models of the library that look most like the object in a box, by the view index."""
    from cadpose.detection.given import parse_box, parse_rotation
    from cadpose.errors import InputError, LibraryError
    from cadpose.library.class_map import category_from_name
    from cadpose.photos import read_photo
    from cadpose.similarity.index.library_index import likely_rotations

    try:
        parsed = parse_box(box)
        rotations = [] if rotation is None else [parse_rotation(rotation)]
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    picture = read_photo(photo)
    opened = open_index(library, index, embedding, device)
    name = category
    if category is not None:
        name = category if category in opened.categories else category_from_name(category) or category
        if name not in opened.categories:
            raise LibraryError(
                f"the view index has no model of category {name!r}, it has "
                f"{', '.join(sorted(opened.categories))}: run `cadpose library index`"
            )
        if not rotations:
            annotator = make_annotator(library, device=device, seed=seed)
            rotations = likely_rotations(annotator.estimate_rotation(picture, parsed, name))
    found = opened.query(picture.rgb, parsed, category=name, rotations=rotations, top=top, rerank=rerank)
    if json:
        print_json(
            {
                "photo": str(photo),
                "box": list(parsed.to_tuple()),
                "category": name,
                "rotations": [[r.azimuth, r.elevation, r.inplane] for r in rotations],
                "models": len(opened),
                "found": [
                    {
                        "cad": m.cad,
                        "category": m.category,
                        "score": m.score,
                        "cosine": m.cosine,
                        "azimuth": m.rotation.azimuth,
                        "elevation": m.rotation.elevation,
                    }
                    for m in found
                ],
            }
        )
        return
    rows = [
        [m.cad, m.category, f"{m.score:.3f}", f"{m.cosine:.3f}", f"{m.rotation.azimuth:.0f}°",
         f"{m.rotation.elevation:+.0f}°"]
        for m in found
    ]  # fmt: skip
    print_table(
        f"{len(found)} of {len(opened)} models",
        ["CAD model", "category", "score", "cosine", "azimuth", "elevation"],
        rows,
    )
