"""``cadpose import``."""

from __future__ import annotations

from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from cadpose.cli.export import Force, FormatName
from cadpose.cli.options import Json
from cadpose.cli.output import complain, print_json

if TYPE_CHECKING:
    from cadpose.annotations.store import Author


def import_(
    name: FormatName,
    path: Annotated[Path, typer.Argument(help="The file or folder of `cadpose export`.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="Write documents into this new folder.")
    ] = None,
    store: Annotated[str | None, typer.Option("--store", help="Write them into this store.")] = None,
    author: Annotated[
        str | None,
        typer.Option(
            "--author", help="With --store: who decided what the file says anew, as a person's word."
        ),
    ] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Read annotations back from the format of another tool, with what was changed there.

    A photo's annotations in the store are replaced by those of the file, but what a person decided there.
    """
    from cadpose.annotations.formats.imports import add_imported
    from cadpose.annotations.formats.registry import documents_from, write_documents
    from cadpose.annotations.store import Store

    if author is not None and (store is None or not author.strip()):
        raise typer.BadParameter("--author is a person's name, and goes with --store")
    if (store is None) == (out is None):
        raise typer.BadParameter("name where the annotations go, either with --store or with --out")
    if store is not None:
        read = changed = 0
        says = _author(name, author)
        documents = iter(documents_from(name, path))
        # What cannot be read at all makes no store.
        first = list(islice(documents, 1))
        with Store(store) as kept:
            for document in chain(first, documents):
                read += 1
                told = add_imported(kept, document, says)
                changed += told is not None
                for sentence in told or ():
                    complain(sentence)
    else:
        assert out is not None
        read = changed = write_documents(documents_from(name, path), out, force=force, inputs=[path])
    if json:
        print_json({"format": name, "photos": read, "changed": changed, "to": store or str(out)})
    else:
        typer.echo(f"{read} photos, {changed} new or changed: {store or out}")


def _author(name: str, person: str | None) -> Author:
    from cadpose import __version__
    from cadpose.annotations.store import Author

    kind: Literal["human", "program"] = "program" if person is None else "human"
    return Author(person or "cadpose", kind, f"cadpose import {name}", __version__)
