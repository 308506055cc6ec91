"""``cadpose blender``."""

from __future__ import annotations

import typer

from cadpose.cli.output import complain

app = typer.Typer(help="Blender as a renderer, in a virtualenv of its own.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep ``setup`` a sub-command though it is the only one."""


@app.command("setup")
def setup() -> None:
    """Make Blender's virtualenv (several hundred MB; GPL-3) and try it."""
    from cadpose.rendering.blender import setup_blender

    python = setup_blender(progress=complain)
    typer.echo(str(python))
