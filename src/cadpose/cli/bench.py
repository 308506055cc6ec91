"""``cadpose bench``."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Annotated, Any

import typer

from cadpose.cli.options import Device, Json, LibraryFolder, Seed, make_annotator
from cadpose.cli.output import complain, print_json, print_table
from cadpose.errors import InputError


def bench(
    photos: Annotated[
        list[str] | None, typer.Argument(metavar="PHOTO...", help="Photographs to time the stages on.")
    ] = None,
    repeats: Annotated[int, typer.Option("--repeats", min=1, help="Timed runs a photo.")] = 3,
    renderers: Annotated[bool, typer.Option(help="Also time the renderers side by side.")] = True,
    galleries: Annotated[bool, typer.Option(help="Also time making templates of models.")] = True,
    synth: Annotated[bool, typer.Option(help="Also time synthetic photos.")] = True,
    against: Annotated[
        Path | None,
        typer.Option("--compare", metavar="FILE", help="An earlier run's JSON: tell what became slower."),
    ] = None,
    tolerance: Annotated[
        float, typer.Option(min=0.0, help="With --compare: exit with 1 where slower by more than this share.")
    ] = 0.25,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """Milliseconds a stage beside their physical floor, of every renderer at hand; galleries and synthetic
    photos a minute.

    Without a photo, a render of the library stands in for one. Read ratios, not single times: they were
    taken in one run on this machine.
    """
    from cadpose.evaluation.bench_compare import compare, read_baseline, slower, unmatched
    from cadpose.evaluation.bench_report import bench as measure
    from cadpose.photos import find_photos, read_photo

    before = read_baseline(against) if against is not None else None
    annotator = make_annotator(library, device=device, seed=seed)
    pictures = [read_photo(p) for p in find_photos(photos)] if photos else []
    wanted = {"renderers": renderers, "galleries": galleries, "synth": synth}
    parts = [part for part, asked in wanted.items() if asked]
    told = measure(annotator, pictures, repeats, parts, complain, device)
    if before is None:
        if json:
            print_json(told)
        else:
            _print(told)
        return
    changes = compare(before, told)
    if json:
        print_json(told | {"changes": [dataclasses.asdict(change) for change in changes]})
    else:
        _print(told)
        print_table(
            "Against the earlier run, the machine's speed taken out",
            ["timing", "before, ms", "now, ms", "ratio"],
            [[c.name, f"{c.before:.1f}", f"{c.after:.1f}", f"{c.ratio:.2f}"] for c in changes],
        )
    if before.get("threads") != told["threads"]:
        complain(f"{against} had {before.get('threads')} threads and this run {told['threads']}")
    if alone := unmatched(before, told):
        complain(f"only one of the runs measured {', '.join(alone)}")
    if not changes:
        raise InputError(f"{against} and this run measured nothing in common")
    if worse := slower(changes, tolerance):
        names = ", ".join(f"{c.name} ({c.ratio:.2f} x)" for c in worse)
        complain(f"slower than in {against} by more than {tolerance:.0%}: {names}")
        raise typer.Exit(1)


def _print(told: dict[str, Any]) -> None:
    stages, floors, total = told["stages"], told["floors"], sum(told["stages"].values())
    rows = []
    for stage, ms in stages.items():
        floor = floors.get(stage)
        beside = ["", "", "", ""]
        if floor is not None:
            least = floor["ms"]
            times = f"{ms / least:.1f} x" if least else ""
            beside = [f"{floor['gflop']:.1f}", f"{floor['mbytes']:.0f}", f"{least:.0f}", times]
        rows.append([stage, f"{ms:.0f}", f"{ms / total:.0%}", *beside])
    least = sum(floor["ms"] for floor in floors.values())
    rows.append(
        ["all", f"{total:.0f}", "100%", "", "", f"{least:.0f}", f"{total / least:.1f} x" if least else ""]
    )
    machine = told["machine"]
    print_table(
        f"A photo, by stage; the floor at {machine['gflops']:.0f} GFLOP/s and {machine['gbytes']:.0f} GB/s",
        ["stage", "ms a photo", "share", "GFLOP", "MB", "floor, ms", "above it"],
        rows,
    )
    for title, part in (("One rotation estimate", "rotation"), ("One joint ranking", "ranking")):
        parts = told[part]
        print_table(
            f"{title}, spread over no threads",
            ["part", "ms", "share"],
            [[name, f"{ms:.1f}", f"{ms / parts['whole']:.0%}"] for name, ms in parts.items()],
        )
    for title, part, key in (
        ("Ten candidates at one rotation, 224 x 224", "candidates", "ms"),
        ("A view of 256 x 256", "renderers", "ms_per_view"),
    ):
        if told[part]:
            lines = [
                [row["name"], f"{row[key]:.2f}", f"{row['ratio']:.1f} x"]
                if row[key] is not None and row["ratio"] is not None
                else [row["name"], "-", row["skipped"]]
                for row in told[part]
            ]
            print_table(title, ["renderer", "ms", "ratio"], lines)
    if made := told["galleries"]:
        print_table(
            f"Templates of a model, {made['views']} views, one core's time",
            ["models a minute", "of which encoding"],
            [[f"{made['per_minute']:.1f}", f"{made['encoding']:.0%}"]],
        )
    if drawn := told["synth"]:
        print_table(
            f"Synthetic photos of {drawn['size']} x {drawn['size']}, one core's time",
            ["work", "photos a second"],
            [["draw", f"{drawn['drawing']:.0f}"], ["draw, encode, write", f"{drawn['writing']:.0f}"]],
        )
