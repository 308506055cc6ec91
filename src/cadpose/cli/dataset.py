"""``cadpose dataset``."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from cadpose.cli.options import Json
from cadpose.cli.output import complain, print_json, print_table, progress_bar

app = typer.Typer(help="Labelled photographs: published data sets as label files.", no_args_is_help=True)


@app.command("convert")
def convert(
    kind: Annotated[
        Literal["pascal3d", "objectnet3d", "pix3d", "imagenet3d", "bop", "labels"],
        typer.Argument(help="Which data set it is; labels: a label file."),
    ],
    root: Annotated[Path, typer.Argument(help="The data set's folder, or the label file.")],
    out: Annotated[Path, typer.Argument(help="The label file to write, NAME.jsonl.")],
    split: Annotated[str | None, typer.Option("--split", help="Only this split: train, val ...")] = None,
    published: Annotated[
        bool, typer.Option("--published", help="Only the objects that published figures count.")
    ] = False,
    json: Json = False,
) -> None:
    """Write a data set's labels as one label file in JSONL; the photos stay where they are.

    Exit code 1: an annotation could not be used; the others were written.
    """
    from cadpose.datasets.labels import write_labels
    from cadpose.datasets.registry import open_dataset
    from cadpose.errors import InputError

    dataset = open_dataset(kind, root, split, published)
    bad: list[str] = []
    counts: Counter[str] = Counter()

    def tell(error: InputError) -> None:
        bad.append(str(error))
        complain(str(error))

    def counted() -> Any:
        for label in dataset.labels(tell, lambda: bar.advance(bar.tasks[0].id)):
            counts[label.category] += 1
            yield label

    with progress_bar("convert", len(dataset)) as bar:
        written = write_labels(out, counted())
    if json:
        print_json({"written": written, "bad": len(bad), "categories": dict(sorted(counts.items()))})
    else:
        rows = [[name, str(count)] for name, count in sorted(counts.items())]
        print_table("Labels", ["category", "labels"], [*rows, ["all", str(written)]])
    if bad:
        raise typer.Exit(1)
