"""``cadpose train``."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from cadpose.cli.options import Backgrounds, Device, Json, LibraryFolder, RendererName, Seed
from cadpose.cli.output import print_json, print_table, progress_bar

if TYPE_CHECKING:
    from cadpose.training.architectures import TrainingOptions, TrainingReport
    from cadpose.training.triplet.options import TripletOptions, TripletReport

app = typer.Typer(help="Train networks on labelled photographs, or on drawn ones.", no_args_is_help=True)


def _known_architecture(name: str) -> str:
    from cadpose.training.architectures import ARCHITECTURES

    if name not in ARCHITECTURES:
        raise typer.BadParameter(f"{name!r} is none of {', '.join(ARCHITECTURES)}")
    return name


_Arch = Annotated[
    str,
    typer.Option("--arch", callback=_known_architecture, help="Network: posecontrast, lite0 or lite0-head."),
]


_Out = Annotated[Path, typer.Option("--out", help="Folder for checkpoint, curves and network.")]
_Validation = Annotated[
    Path | None, typer.Option("--val", help="Label file to measure on after every epoch.")
]
_Steps = Annotated[int | None, typer.Option("--steps", min=1, help="Optimiser steps.")]
_Drawers = Annotated[int, typer.Option("--workers", min=0, help="Processes that draw; 0: one a core.")]
_Resume = Annotated[bool, typer.Option("--resume", help="Go on with the training in --out.")]


def _only_its_own(arch: str, given: dict[str, Any]) -> None:
    """Refuse options that the architecture does not take; ``given`` is by name of the option."""
    from cadpose.training.architectures import TAKES

    for name, value in given.items():
        if value is not None and name not in TAKES[arch]:
            flag = {"validation": "--val", "batch_size": "--batch"}.get(name, f"--{name}")
            raise typer.BadParameter(f"{flag} means nothing to {arch}")
    if "data" in TAKES[arch] and given["data"] is None:
        raise typer.BadParameter(f"{arch} is trained on labelled photos: name them with --data")


@app.command("rotation")
def rotation(
    out: _Out,
    data: Annotated[
        Path | None, typer.Option("--data", help="Label file: photo, box, category, azimuth ...")
    ] = None,
    arch: _Arch = "posecontrast",
    library: LibraryFolder = None,
    backgrounds: Backgrounds = None,
    photos: Annotated[int | None, typer.Option("--photos", min=1, help="Photos to draw.")] = None,
    steps: _Steps = None,
    validation: _Validation = None,
    init: Annotated[
        str | None, typer.Option("--init", help="Weights to start from: moco, random or a file.")
    ] = None,
    epochs: Annotated[int | None, typer.Option("--epochs", min=1, help="Passes over the data.")] = None,
    batch: Annotated[int | None, typer.Option("--batch", min=2, help="Photos or objects a step.")] = None,
    workers: Annotated[
        int,
        typer.Option(
            "--workers", min=0, help="Threads that read photos, or processes that draw; 0: one a core."
        ),
    ] = 0,
    resume: _Resume = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Train a network that tells the rotation."""
    from cadpose.training.architectures import TrainingOptions, architecture

    own: dict[str, Any] = {
        "data": data,
        "validation": validation,
        "init": init,
        "epochs": epochs,
        "batch_size": batch,
        "library": library,
        "backgrounds": backgrounds,
        "photos": photos,
        "steps": steps,
    }
    _only_its_own(arch, own)
    trainer = architecture(arch)
    options = TrainingOptions(
        out=out,
        **own,
        device=device,
        seed=seed,
        resume=resume,
        workers=workers,
    )
    report = _trained(trainer, options)
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
    _print_epochs(arch, list(report.epochs[-1]) if report.epochs else ["epoch"], report)


@app.command("triplet")
def triplet(
    data: Annotated[
        Path, typer.Option("--data", help="Label file: photo, cad, azimuth, elevation, box, mask ...")
    ],
    out: _Out,
    library: LibraryFolder = None,
    validation: _Validation = None,
    init: Annotated[
        str, typer.Option("--init", help="Weights to start from: imagenet, random or a file.")
    ] = "imagenet",
    trained_blocks: Annotated[
        int | None,
        typer.Option("--trained-blocks", min=1, max=5, help="Blocks of VGG16 that learn, from the last."),
    ] = None,
    epochs: Annotated[int | None, typer.Option("--epochs", min=1, help="Passes over the photos.")] = None,
    batch: Annotated[int | None, typer.Option("--batch", min=1, help="Photos a step.")] = None,
    mining: Annotated[bool, typer.Option("--mining", help="Use the nearest negatives again.")] = False,
    renderer: RendererName = "raster",
    workers: Annotated[
        int, typer.Option("--workers", min=0, help="Threads that read and draw; 0: one a core.")
    ] = 0,
    resume: _Resume = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Train the paper's learned baseline, which ranks CAD models: two encoders and a triplet loss."""
    from cadpose.training.architectures import training_module
    from cadpose.training.triplet.options import TripletOptions

    trainer = training_module("cadpose.training.triplet.train")
    options = TripletOptions(
        data=data,
        out=out,
        library=library,
        validation=validation,
        init=init,
        trained_blocks=trained_blocks,
        epochs=epochs,
        batch_size=batch,
        mining=mining,
        renderer=renderer,
        device=device,
        seed=seed,
        resume=resume,
        workers=workers,
    )
    report = _trained(trainer, options)
    if json:
        print_json(
            {
                "network": str(report.network),
                "checkpoint": str(report.checkpoint),
                "curves": str(report.curves),
                "initial": report.initial,
                "photos": report.photos,
                "unmasked": report.unmasked,
                "epochs": report.epochs,
                "validation": report.validation,
                "export_difference": report.difference,
            }
        )
        return
    _print_epochs(f"triplet, from {report.initial} weights", list(report.epochs[-1]), report)


@app.command("masks")
def masks(
    out: _Out,
    library: LibraryFolder = None,
    backgrounds: Backgrounds = None,
    steps: _Steps = None,
    batch: Annotated[int | None, typer.Option("--batch", min=2, help="Objects a step.")] = None,
    workers: _Drawers = 0,
    resume: _Resume = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Train the network that finds the mask of the object in a box."""
    from cadpose.training.architectures import TrainingOptions

    options = TrainingOptions(
        out=out,
        library=library,
        backgrounds=backgrounds,
        steps=steps,
        batch_size=batch,
        workers=workers,
        resume=resume,
        device=device,
        seed=seed,
    )
    _drawn_training("masks", ("step", "iou", "median", "over90"), options, json)


@app.command("refinement")
def refinement(
    out: _Out,
    library: LibraryFolder = None,
    backgrounds: Backgrounds = None,
    steps: _Steps = None,
    batch: Annotated[int | None, typer.Option("--batch", min=2, help="Pairs a step.")] = None,
    workers: _Drawers = 0,
    resume: _Resume = False,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Train the network that tells how a drawn model must be turned to lie on the photo."""
    from cadpose.training.architectures import TrainingOptions

    options = TrainingOptions(
        out=out,
        library=library,
        backgrounds=backgrounds,
        steps=steps,
        batch_size=batch,
        workers=workers,
        resume=resume,
        device=device,
        seed=seed,
    )
    columns = ("step", "before", "median", "within5", "within10", "focal")
    _drawn_training("refinement", columns, options, json)


def _drawn_training(name: str, columns: Sequence[str], options: TrainingOptions, json: bool) -> None:
    """Train by ``cadpose.training.NAME.train`` on what is drawn from a library, and print what came of it."""
    from cadpose.training.architectures import training_module

    report = _trained(training_module(f"cadpose.training.{name}.train"), options)
    if json:
        paths = {"network": str(report.network), "checkpoint": str(report.checkpoint)}
        print_json({**paths, "curves": str(report.curves), "validation": report.validation})
        return
    _print_epochs(name, columns, report)


def _trained(trainer: Any, options: TrainingOptions | TripletOptions) -> Any:
    """What a module's ``train`` made by the options, with a bar while it trains."""
    with progress_bar("training", None) as bar:
        return trainer.train(
            options, lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total)
        )


def _print_epochs(title: str, columns: Sequence[str], report: TrainingReport | TripletReport) -> None:
    print_table(title, columns, [[_number(row.get(c)) for c in columns] for row in report.epochs])
    typer.echo(f"Network: {report.network}")


@app.command("export")
def export(
    weights: Annotated[str, typer.Argument(help="A checkpoint, or a known name: posecontrast-pascal3d.")],
    out: Annotated[Path, typer.Option("--out", help="ONNX file to write.")],
    arch: _Arch = "posecontrast",
    head: Annotated[
        list[Path] | None,
        typer.Option("--head", help="head.pt of lite0-head, a further member of lite0; again for more."),
    ] = None,
    embedding: Annotated[
        Path | None, typer.Option("--embedding", help="lite0: ONNX file to write the view embedder to.")
    ] = None,
    json: Json = False,
) -> None:
    """Export a trained checkpoint, yours or its authors', as ONNX."""
    from cadpose.errors import InputError
    from cadpose.training.architectures import architecture

    for path in (out,) if embedding is None else (out, embedding):
        if os.path.realpath(path) in {os.path.realpath(given) for given in (weights, *(head or ()))}:
            raise InputError(f"{path} is the checkpoint and would be written over: name another file")
    if embedding is not None and os.path.realpath(embedding) == os.path.realpath(out):
        raise InputError(f"{out} is named for both networks: name two files")
    difference = architecture(arch).export(weights, out, head or (), embedding)
    if json:
        print_json({"network": str(out), "export_difference": difference})
    else:
        typer.echo(f"Network: {out}")


def _number(value: Any) -> str:
    return "" if value is None else f"{value:.4g}"
