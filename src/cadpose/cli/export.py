"""``cadpose export``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from cadpose.cli.options import Categories, Json, LibraryFolder
from cadpose.cli.output import print_json

#: What may hold of an annotation; the last two only of a store's.
_VERDICTS = ("auto_accept", "review", "reject", "undecided", "accept", "edit")


def _known_format(name: str) -> str:
    from cadpose.annotations.formats.registry import FORMATS

    if name not in FORMATS:
        raise typer.BadParameter(f"{name!r} is none of {', '.join(FORMATS)}")
    return name


def _known_verdicts(names: list[str] | None) -> list[str] | None:
    for name in names or ():
        if name not in _VERDICTS:
            raise typer.BadParameter(f"{name!r} is none of {', '.join(_VERDICTS)}")
    return names


FormatName = Annotated[
    str,
    typer.Argument(
        metavar="FORMAT",
        callback=_known_format,
        help="coco, bop, pix3d, pascal3d, label-studio, fiftyone, gltf, usd, parquet, csv.",
    ),
]
Force = Annotated[bool, typer.Option("--force", help="Replace what is at --out.")]


def export(
    name: FormatName,
    out: Annotated[Path, typer.Option("--out", "-o", help="File or folder to write, as the format is.")],
    store: Annotated[str | None, typer.Option("--store", help="Take the annotations of this store.")] = None,
    documents: Annotated[
        list[Path] | None,
        typer.Option("--from", help="Take documents of `cadpose annotate`, files or folders; repeatable."),
    ] = None,
    photos: Annotated[
        Path | None, typer.Option("--photos", help="Folder of the photos, for formats that hold them.")
    ] = None,
    library: LibraryFolder = None,
    category: Categories = None,
    verdict: Annotated[
        list[str] | None,
        typer.Option(
            "--verdict",
            callback=_known_verdicts,
            help="Only annotations of this verdict: auto_accept, review, reject, undecided, and of a store "
            "accept and edit; repeatable. Unless told, all of a store but what a person rejected.",
        ),
    ] = None,
    camera: Annotated[
        Literal["object", "photo"],
        typer.Option(
            "--camera", help="bop, pix3d, gltf, usd: poses in each object's own camera, or in the photo's."
        ),
    ] = "object",
    force: Force = False,
    json: Json = False,
) -> None:
    """Write annotations in the format of another tool."""
    from cadpose.annotations.formats.registry import export as write
    from cadpose.annotations.formats.sources import Sources, chosen, documents_in, documents_of_store
    from cadpose.library.catalogue import default_path

    if (store is None) == (not documents):
        raise typer.BadParameter("name where the annotations are, either with --store or with --from")
    # Replacing the library that is taken unless told would lose it as well.
    held = [path for path in (photos, library or default_path()) if path is not None]
    inputs = [*(documents or ()), *_places(store), *held]
    sources = Sources(library, photos, camera == "photo")
    if store is None:
        if people := [word for word in verdict or () if word in ("accept", "edit")]:
            raise typer.BadParameter(
                f"documents hold no decisions of people: --verdict {people[0]} needs --store"
            )
        told = chosen(documents_in(documents or ()), category or (), verdict or ())
    else:
        told = chosen(documents_of_store(store, verdict or ()), category or ())
    count = write(name, told, out, sources, force=force, inputs=inputs)
    if json:
        print_json({"format": name, "annotations": count, "out": str(out)})
    else:
        typer.echo(f"{count} annotations: {out}")


def _places(store: str | None) -> list[Path]:
    """The store's file, where it is one."""
    from cadpose.annotations.formats.sources import store_file

    path = None if store is None else store_file(store)
    return [] if path is None else [path]
