"""``cadpose library search``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cadpose.cli.options import Device, Json, LibraryFolder, Seed, make_annotator
from cadpose.cli.output import print_json, print_table
from cadpose.cli.view_index import Draw, Embedding, IndexFolder, open_drawn, open_index


def search(
    photo: Annotated[Path, typer.Argument(help="Photograph.")],
    box: Annotated[str, typer.Option("--box", help="x0,y0,x1,y1 of the object in pixels.")],
    category: Annotated[
        str | None, typer.Option("--category", help="Only models of this library category.")
    ] = None,
    rotation: Annotated[
        str | None,
        typer.Option(
            "--rotation",
            help="azimuth,elevation[,inplane] in degrees; with --category it is estimated, without it all "
            "views take part.",
        ),
    ] = None,
    top: Annotated[int, typer.Option("--top", min=1, max=10_000, help="Models to find.")] = 50,
    rerank: Annotated[
        bool, typer.Option("--rerank/--no-rerank", help="Rank them by their small maps too.")
    ] = True,
    draw: Draw = 10,
    embedding: Embedding = None,
    index: IndexFolder = None,
    library: LibraryFolder = None,
    json: Json = False,
    device: Device = "cpu",
    seed: Seed = 0,
) -> None:
    """The models of the library that look most like the object in a box, by the view index."""
    from cadpose.detection.given import parse_box, parse_rotation
    from cadpose.errors import InputError, LibraryError
    from cadpose.library.class_map import category_from_name
    from cadpose.photos import read_photo

    try:
        parsed = parse_box(box)
        rotations = [] if rotation is None else [parse_rotation(rotation)]
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    picture = read_photo(photo)
    within = parsed.clipped(picture.width, picture.height)
    if within is None:
        raise InputError(
            f"the box {box} lies outside {photo}, which has {picture.width} x {picture.height} pixels: "
            "give x0,y0,x1,y1 within it"
        )
    parsed = within
    opened = open_index(library, index, embedding, device)
    name = category
    if category is not None:
        name = category if category in opened.categories else category_from_name(category) or category
        if name not in opened.categories:
            raise LibraryError(
                f"the view index has no model of category {name!r}, it has "
                f"{', '.join(sorted(opened.categories))}: check the spelling, or run "
                f"`cadpose library index` for what the library holds"
            )
        if not rotations:
            annotator = make_annotator(library, device=device, seed=seed)
            rotations = opened.likely_rotations(annotator.estimate_rotation(picture, parsed, name))
    found = opened.query(picture.rgb, parsed, category=name, rotations=rotations, top=top, rerank=rerank)
    if draw:
        found = open_drawn(library, device).rank(found, picture.rgb, parsed, rotations, draw)
    if json:
        print_json(
            {
                "photo": str(photo),
                "box": list(parsed.to_tuple()),
                "category": name,
                "rotations": [[r.azimuth, r.elevation, r.inplane] for r in rotations],
                "models": len(opened),
                "found": [
                    {
                        "cad": m.cad,
                        "category": m.category,
                        "score": m.score,
                        "cosine": m.cosine,
                        "azimuth": m.rotation.azimuth,
                        "elevation": m.rotation.elevation,
                    }
                    for m in found
                ],
            }
        )
        return
    rows = [
        [m.cad, m.category, f"{m.score:.3f}", f"{m.cosine:.3f}", f"{m.rotation.azimuth:.0f}°",
         f"{m.rotation.elevation:+.0f}°"]
        for m in found
    ]  # fmt: skip
    print_table(
        f"{len(found)} of {len(opened)} models",
        ["CAD model", "category", "score", "cosine", "azimuth", "elevation"],
        rows,
    )
