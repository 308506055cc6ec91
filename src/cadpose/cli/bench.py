"""``cadpose bench``."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import typer

from cadpose.cli.options import Device, Json, LibraryFolder, Seed, make_annotator
from cadpose.cli.output import complain, print_json, print_table


def bench(
    photos: Annotated[
        list[str] | None, typer.Argument(metavar="PHOTO...", help="Photographs to time the stages on.")
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Timed runs a photo.")] = 3,
    renderers: Annotated[bool, typer.Option(help="Also time the renderers side by side.")] = True,
    synth: Annotated[bool, typer.Option(help="Also time synthetic photos.")] = True,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Milliseconds a stage on photographs and a view of every renderer at hand; synthetic photos a second.

    Without a photo, a render of the library stands in for one. Read ratios, not single times: they were
    taken in one run on this machine.
    """
    from cadpose.evaluation.bench_ranking import bench_ranking
    from cadpose.evaluation.bench_rendering import bench_renderers
    from cadpose.evaluation.bench_rotation import bench_rotation
    from cadpose.evaluation.bench_stages import STAND_IN_BOX, bench_meshes, bench_stages, stand_in_photo
    from cadpose.evaluation.bench_synth import bench_synth
    from cadpose.photos import find_photos, read_photo

    annotator = make_annotator(library, device=device, seed=seed)
    pictures = [read_photo(p) for p in find_photos(photos)] if photos else [stand_in_photo(annotator)]
    stages = bench_stages(annotator, pictures, repeats)
    stand_in = stand_in_photo(annotator)
    rotation = bench_rotation(annotator, stand_in, STAND_IN_BOX, max(repeats, 5))
    ranking = bench_ranking(annotator, stand_in, STAND_IN_BOX, max(repeats, 5))
    timings = []
    if renderers:
        timings = bench_renderers(
            bench_meshes(annotator.library),
            progress=complain,
        )
    drawn = bench_synth(annotator.library) if synth else None
    if json:
        print_json(
            {
                "stages": stages,
                "rotation": rotation,
                "ranking": ranking,
                "renderers": [dataclasses.asdict(t) for t in timings],
                "synth": drawn and dataclasses.asdict(drawn),
            }
        )
        return
    total = sum(stages.values())
    rows = [[stage, f"{ms:.0f}", f"{ms / total:.0%}"] for stage, ms in stages.items()]
    print_table(
        "A photo, by stage", ["stage", "ms a photo", "share"], [*rows, ["all", f"{total:.0f}", "100%"]]
    )
    for title, parts in (("One rotation estimate", rotation), ("One joint ranking", ranking)):
        print_table(
            f"{title}, one core",
            ["part", "ms", "share"],
            [[part, f"{ms:.1f}", f"{ms / parts['whole']:.0%}"] for part, ms in parts.items()],
        )
    if timings:
        lines = [
            [t.name, f"{t.ms_per_view:.2f}", f"{t.ratio:.1f} x"]
            if t.ms_per_view is not None and t.ratio is not None
            else [t.name, "-", t.skipped]
            for t in timings
        ]
        print_table("A view of 256 x 256", ["renderer", "ms a view", "ratio"], lines)
    if drawn is not None:
        print_table(
            f"Synthetic photos of {drawn.size} x {drawn.size}, one core",
            ["work", "photos a second"],
            [["draw", f"{drawn.drawing:.0f}"], ["draw, encode, write", f"{drawn.writing:.0f}"]],
        )
