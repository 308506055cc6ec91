"""``cadpose schema``."""

from __future__ import annotations

from typing import Annotated, Literal

import typer

from cadpose.cli.output import print_table


def schema(
    name: Annotated[
        Literal["annotation", "failure", "network"] | None,
        typer.Argument(help="Which file's; without it they are listed.", metavar="NAME"),
    ] = None,
) -> None:
    """Print the JSON Schema of a file that cadpose writes or takes."""
    from cadpose.schemas import PUBLISHED

    if name is None:
        rows = [[each.name, each.version, each.about] for each in PUBLISHED.values()]
        print_table("JSON Schemas", ["name", "version", "of"], rows)
    else:
        typer.echo(PUBLISHED[name].text(), nl=False)
