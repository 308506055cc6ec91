"""``cadpose detectors``."""

from __future__ import annotations

import typer

from cadpose.cli.output import complain

app = typer.Typer(help="DetectoRS's packages, in a folder of their own.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep ``setup`` a sub-command though it is the only one."""


@app.command("setup")
def setup() -> None:
    """Fetch OpenMMLab's packages for `--detector detectors` (34 MB unpacked; Apache-2.0) and try them."""
    from cadpose.detection.mmdet.packages import setup_detectors

    typer.echo(str(setup_detectors(progress=complain)))
