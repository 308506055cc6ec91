"""The ``cadpose`` command."""

from __future__ import annotations

import io
import sys
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from cadpose import __version__
from cadpose.cli import (
    annotate,
    bench,
    blender,
    dataset,
    db,
    detect,
    detectors,
    doctor,
    evaluate,
    experiment,
    export,
    import_,
    library,
    replace,
    review,
    schema,
    synth,
    train,
)
from cadpose.cli.output import set_up_logging, user_errors


class _Verbs(TyperGroup):
    """Every verb's errors are told in one place."""

    def invoke(self, ctx: Any) -> Any:
        with user_errors():
            return super().invoke(ctx)


app = typer.Typer(
    name="cadpose",
    cls=_Verbs,
    help="Which CAD model is the object in this photo, and how is it turned?",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"cadpose {__version__}")
        raise typer.Exit


@app.callback()
def _root(
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Log what happens, on stderr.")] = False,
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    set_up_logging(verbose)


app.command("annotate")(annotate.annotate)
app.command("detect")(detect.detect)
app.add_typer(evaluate.app, name="evaluate")
app.add_typer(experiment.app, name="experiment")
app.add_typer(library.app, name="library")
app.add_typer(dataset.app, name="dataset")
app.add_typer(db.app, name="db")
app.command("doctor")(doctor.doctor)
app.command("export")(export.export)
app.command("import")(import_.import_)
app.command("bench")(bench.bench)
app.command("schema")(schema.schema)
app.command("review")(review.review)
app.command("replace")(replace.replace)
app.command("synth")(synth.synth)
app.add_typer(train.app, name="train")
app.add_typer(blender.app, name="blender")
app.add_typer(detectors.app, name="detectors")


def main() -> None:
    """Entry point of the console script."""
    # Names of files need not be text, and a terminal need not know every letter.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    app()
