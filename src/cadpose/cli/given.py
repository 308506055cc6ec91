"""The objects that the command line tells, in place of a detector: drawn there, or named as a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from cadpose.batch.told import ToldObjects

Boxes = Annotated[
    list[str] | None, typer.Option("--box", help="x0,y0,x1,y1 in pixels, instead of the detector.")
]
Polygons = Annotated[
    list[str] | None, typer.Option("--polygon", help="'x,y x,y x,y ...' in pixels: an object's outline.")
]
MaskFiles = Annotated[list[Path] | None, typer.Option("--mask", help="PNG of one photo's object or objects.")]
Rotations = Annotated[
    list[str] | None,
    typer.Option("--rotation", help="azimuth,elevation,inplane of the objects, in degrees."),
]
DetectionsFile = Annotated[
    Path | None,
    typer.Option("--detections", help="COCO JSON, Label Studio's JSON, or a folder of PNG masks."),
]


def objects_told(
    boxes: list[str] | None,
    polygons: list[str] | None,
    masks: list[Path] | None,
    categories: list[str] | None,
    rotations: list[str] | None,
    file: Path | None,
) -> ToldObjects | None:
    """What the options tell of the objects; None where they leave them to the detector.

    Raises:
        BadParameter: they exclude each other, do not fit in number, or are no numbers.
    """
    from cadpose.batch.told import ToldObjects
    from cadpose.errors import InputError

    drawn = bool(boxes or polygons or masks)
    if file is not None:
        if drawn or rotations:
            raise typer.BadParameter(
                "give either --detections or --box, --polygon, --mask and --rotation, not both"
            )
        return ToldObjects(categories=tuple(categories or ()), file=file)
    if not drawn:
        if rotations:
            raise typer.BadParameter(
                "--rotation belongs to --box, --polygon or --mask: give the place of the object too"
            )
        return None
    count = len(boxes or []) + len(polygons or [])
    for option, given in (("--category", categories), ("--rotation", rotations)):
        # A mask may show several objects: how many is known when it is read.
        if given and not masks and len(given) not in (1, count):
            raise typer.BadParameter(f"{option} was given {len(given)} times for {count} objects")
    told = ToldObjects(
        tuple(boxes or ()),
        tuple(polygons or ()),
        tuple(masks or ()),
        tuple(categories or ()),
        tuple(rotations or ()),
    )
    try:
        told.open()
    except InputError as error:
        raise typer.BadParameter(str(error)) from None
    return told
