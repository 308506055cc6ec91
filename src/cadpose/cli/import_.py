"""``cadpose import``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cadpose.cli.export import Force, FormatName
from cadpose.cli.options import Json
from cadpose.cli.output import print_json


def import_(
    name: FormatName,
    path: Annotated[Path, typer.Argument(help="The file or folder of `cadpose export`.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write documents into this new folder.")
    ] = None,
    store: Annotated[str | None, typer.Option("--store", help="Write them into this store.")] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Read annotations back from the format of another tool, with what was changed there.

    A photo's annotations in the store are replaced by those of the file.
    """
    from cadpose.annotations.formats.registry import documents_from, write_documents
    from cadpose.annotations.store import Store

    if (store is None) == (out is None):
        raise typer.BadParameter("name where the annotations go, either with --store or with --out")
    if store is not None:
        read = changed = 0
        with Store(store) as kept:
            for document in documents_from(name, path):
                read += 1
                changed += bool(kept.add(document))
    else:
        assert out is not None
        read = changed = write_documents(documents_from(name, path), out, force=force, inputs=[path])
    if json:
        print_json({"format": name, "photos": read, "changed": changed, "to": store or str(out)})
    else:
        typer.echo(f"{read} photos, {changed} new or changed: {store or out}")
