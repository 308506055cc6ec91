"""``cadpose train``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from cadpose.cli.options import Device, Json, Seed
from cadpose.cli.output import print_json, print_table, progress_bar

app = typer.Typer(help="Train networks on labelled photographs.", no_args_is_help=True)


def _known_architecture(name: str) -> str:
    from cadpose.training.architectures import ARCHITECTURES

    if name not in ARCHITECTURES:
        raise typer.BadParameter(f"{name!r} is none of {', '.join(ARCHITECTURES)}")
    return name


_Arch = Annotated[str, typer.Option("--arch", callback=_known_architecture, help="Network: posecontrast.")]


@app.command("rotation")
def rotation(
    data: Annotated[Path, typer.Option("--data", help="Label file: photo, box, category, azimuth ...")],
    out: Annotated[Path, typer.Option("--out", help="Folder for checkpoint, curves and network.")],
    arch: _Arch = "posecontrast",
    validation: Annotated[
        Path | None, typer.Option("--val", help="Label file to measure on after every epoch.")
    ] = None,
    init: Annotated[
        str | None, typer.Option("--init", help="Weights to start from: moco, random or a file.")
    ] = None,
    epochs: Annotated[int | None, typer.Option("--epochs", min=1, help="Passes over the data.")] = None,
    batch: Annotated[int | None, typer.Option("--batch", min=2, help="Photos a step.")] = None,
    workers: Annotated[
        int, typer.Option("--workers", min=0, help="Threads that read photos; 0: one a core.")
    ] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint in --out.")] = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Train a network that tells the rotation, and export it as ONNX."""
    from cadpose.training.architectures import TrainingOptions, architecture

    trainer = architecture(arch)
    options = TrainingOptions(
        data=data,
        out=out,
        validation=validation,
        init=init,
        epochs=epochs,
        batch_size=batch,
        device=device,
        seed=seed,
        resume=resume,
        workers=workers,
    )
    with progress_bar("training", None) as bar:
        report = trainer.train(
            options, lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total)
        )
    if json:
        print_json(
            {
                "network": str(report.network),
                "checkpoint": str(report.checkpoint),
                "curves": str(report.curves),
                "epochs": report.epochs,
                "validation": report.validation,
                "export_difference": report.difference,
            }
        )
        return
    columns = list(report.epochs[-1]) if report.epochs else ["epoch"]
    print_table(arch, columns, [[_number(row.get(c)) for c in columns] for row in report.epochs])
    typer.echo(f"Network: {report.network}")


@app.command("export")
def export(
    weights: Annotated[str, typer.Argument(help="A checkpoint, or a known name: posecontrast-pascal3d.")],
    out: Annotated[Path, typer.Option("--out", help="ONNX file to write.")],
    arch: _Arch = "posecontrast",
    json: Json = False,
) -> None:
    """Export a trained checkpoint, yours or its authors', as ONNX."""
    from cadpose.training.architectures import architecture

    difference = architecture(arch).export(weights, out)
    if json:
        print_json({"network": str(out), "export_difference": difference})
    else:
        typer.echo(f"Network: {out}")


def _number(value: Any) -> str:
    return "" if value is None else f"{value:.4g}"
