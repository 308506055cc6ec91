"""``cadpose synth``."""

from __future__ import annotations

import os
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from cadpose.cli.options import (
    Backgrounds,
    Categories,
    Json,
    LibraryFolder,
    Panoramas,
    PhotoSide,
    RendererName,
    Samples,
    Seed,
)
from cadpose.cli.output import complain, print_json, print_table, progress_bar


def synth(
    out: Annotated[Path, typer.Argument(help="Folder for photos, labels.jsonl, coco.json and sheet.jpg.")],
    count: Annotated[int, typer.Option("--count", min=1, help="Photos in the folder.")] = 100,
    size: PhotoSide = 224,
    category: Categories = None,
    held_out: Annotated[
        bool,
        typer.Option("--held-out", help="Only models that no shipped network was trained on."),
    ] = False,
    backgrounds: Backgrounds = None,
    renderer: RendererName = "raster",
    hdri: Panoramas = None,
    samples: Samples = 16,
    format: Annotated[Literal["jpg", "png"], typer.Option("--format", help="File format.")] = "jpg",
    warp: Annotated[
        float, typer.Option("--warp", min=0, max=3, help="Strength of shape warps; 0: models as they are.")
    ] = 1.0,
    redress: Annotated[
        bool, typer.Option("--redress/--no-redress", help="Change colours and textures.")
    ] = True,
    beside: Annotated[
        bool, typer.Option("--objects-beside/--no-objects-beside", help="Draw further objects.")
    ] = True,
    covers: Annotated[
        bool, typer.Option("--covers/--no-covers", help="Put things in front of the main object.")
    ] = True,
    truncate: Annotated[
        bool, typer.Option("--truncate/--no-truncate", help="Let the border cut main objects off.")
    ] = True,
    shadows: Annotated[
        bool, typer.Option("--shadows/--no-shadows", help="Draw shadows on the ground.")
    ] = True,
    flaws: Annotated[
        bool, typer.Option("--flaws/--no-flaws", help="Blur, noise, exposure, low resolution, JPEG.")
    ] = True,
    workers: Annotated[
        int | None, typer.Option("--workers", min=1, help="Processes; one a core unless told.")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with a folder of the same settings.")
    ] = False,
    library: LibraryFolder = None,
    json: Json = False,
    seed: Seed = 0,
) -> None:
    """Draw synthetic photos of CAD models, with exact labels."""
    from cadpose.annotations.files import write_atomic
    from cadpose.annotations.style import jpeg_bytes
    from cadpose.errors import LibraryError
    from cadpose.library.catalogue import Library
    from cadpose.training.held_out import read_held_out
    from cadpose.training.synth.options import SynthOptions
    from cadpose.training.synth.recipe import Recipe
    from cadpose.training.synth.sheet import sheet
    from cadpose.training.synth.writer import LABELS, write_photos

    usual = SynthOptions()
    options = SynthOptions(
        size=size,
        warp=warp,
        redress=usual.redress if redress else 0.0,
        company=usual.company if beside else 0.0,
        occluder=usual.occluder if covers else 0.0,
        truncate=usual.truncate if truncate else 0.0,
        shadow=usual.shadow if shadows else 0.0,
        degrade=usual.degrade if flaws else 0.0,
    )
    opened = Library.open(library)
    kept = None
    if held_out:
        by_category = read_held_out(lookalikes=False)
        kept = {i for ids in by_category.values() for i in ids}
        if not any(m.id in kept for m in opened.models() if not category or m.category in category):
            raise LibraryError(
                f"{opened.path} has none of the held-out models, which are of "
                f"{', '.join(sorted(by_category))}: name one of these, or add them with "
                "`cadpose library add sweethome3d`"
            )
    recipe = Recipe.from_library(
        opened,
        category,
        only=kept,
        backdrops=backgrounds,
        options=options,
        seed=seed,
        renderer=renderer,
        hdri=hdri,
        samples=samples,
    )
    with progress_bar("draw", count) as bar:
        report = write_photos(
            recipe,
            out,
            count,
            format=format,
            workers=workers or os.cpu_count() or 1,
            resume=resume,
            progress=lambda done, total: bar.update(bar.tasks[0].id, completed=done, total=total),
        )
    if report.objects:
        write_atomic(out / "sheet.jpg", jpeg_bytes(sheet(out / LABELS)))
    if json:
        print_json({**asdict(report), "out": str(report.out)})
        return
    total = sum(report.objects.values())
    rows = [[name, str(number), f"{number / total:.0%}"] for name, number in report.objects.items()]
    print_table(
        f"{report.photos} photos, {total} labelled objects", ["category", "objects", "share"],
        [*rows, ["all", str(total), ""], ["truncated", str(report.truncated), ""],
         ["occluded", str(report.occluded), ""]],
    )  # fmt: skip
    complain(f"{report.drawn} photos drawn; look at {out / 'sheet.jpg'}")
