"""``cadpose experiment scale``."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from cadpose.cli.options import Device, Json, LibraryFolder, Seed
from cadpose.cli.output import complain, print_json, print_table, progress_bar
from cadpose.cli.view_index import Embedding

#: The number of models of ShapeNetCore, and what leads up to it.
_SIZES = "1000,5000,10000,20000,51300"


def scale(
    out: Annotated[Path, typer.Argument(help="Folder for the index, its figures and the plot.")],
    models: Annotated[
        str, typer.Option("--models", help="Numbers of models, ascending; copies are warped as needed.")
    ] = _SIZES,
    queries: Annotated[int, typer.Option("--queries", min=1, help="Photos that are looked for.")] = 40,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Threads that build; one a core unless told.")
    ] = None,
    embedding: Embedding = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a folder of the same settings.")
    ] = False,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """How the view index grows: size, build rate, memory, time of a query and recall up to 51,300 models.

    The real models and warped copies of them are indexed as by `cadpose library index`.
    """
    from cadpose.evaluation.figures import require_matplotlib
    from cadpose.evaluation.scale_experiment import PLOT, run_scale, scale_plot
    from cadpose.library.catalogue import Library
    from cadpose.library.storage import write_atomic
    from cadpose.similarity.embedding import embedding_network

    try:
        sizes = sorted({int(part) for part in models.split(",")})
    except ValueError:
        sizes = []
    if not sizes or sizes[0] < 1 or sizes[-1] > 1_000_000:
        raise typer.BadParameter(f"--models {models} is no list of numbers from 1 to 1000000")
    require_matplotlib()
    with progress_bar("index", sizes[-1]) as bar:
        rows = run_scale(
            out,
            Library.open(library),
            sizes,
            embedding_network(embedding).read_bytes(),
            queries=queries,
            workers=workers or os.cpu_count() or 1,
            seed=seed,
            device=device,
            resume=resume,
            progress=lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total),
        )
    write_atomic(out / PLOT, scale_plot(rows))
    if json:
        print_json([asdict(row) for row in rows])
        return
    for title, kind in (("category and rotation given", "filtered"), ("all models, all views", "unfiltered")):
        figures = [(row.models, getattr(row, kind)) for row in rows]
        print_table(
            f"Queries, {title}",
            ["models", "median ms", "95 % ms", "recall@50", "own model in 50"],
            [
                [
                    str(n),
                    f"{q.median_ms:.0f}",
                    f"{q.p95_ms:.0f}",
                    f"{q.recall:.3f}",
                    f"{q.found:.0%}",
                ]
                for n, q in figures
            ],
        )
    print_table(
        "The index",
        ["models", "MB", "built in s", "models/s", "CPU ms a model", "opened in s", "most GB of memory"],
        [
            [
                str(row.models),
                f"{row.megabytes:.0f}",
                f"{row.build_seconds:.0f}",
                f"{row.models_per_second:.1f}",
                f"{row.cpu_ms_a_model:.0f}",
                f"{row.open_seconds:.1f}",
                f"{row.peak_rss_gb:.2f}",
            ]
            for row in rows
        ],
    )
    complain(f"the plot is {out / PLOT}")
