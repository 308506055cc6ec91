"""``cadpose review``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from cadpose.cli.db import StoreUrl
from cadpose.cli.options import Device, Json, LibraryFolder
from cadpose.cli.output import complain, print_json


def review(
    store: StoreUrl,
    photos: Annotated[
        list[Path] | None,
        typer.Option(
            "--photos",
            help="Folder in which photos may be read, found by their content; repeatable. The store's own "
            "folder unless told.",
        ),
    ] = None,
    library: LibraryFolder = None,
    author: Annotated[
        str | None, typer.Option("--author", help="Who decides; your user name unless told.")
    ] = None,
    host: Annotated[str, typer.Option("--host", help="Address to serve on.")] = "127.0.0.1",
    port: Annotated[
        int, typer.Option("--port", min=0, max=65535, help="Port to serve on; 0: any that is free.")
    ] = 0,
    allow_remote: Annotated[
        bool, typer.Option("--allow-remote", help="Let --host be an address that other machines reach.")
    ] = False,
    no_open: Annotated[bool, typer.Option("--no-open", help="Do not open the browser.")] = False,
    json: Json = False,
    device: Device = "cpu",
) -> None:
    """Look through annotations in the browser, correct and decide on them; a missing store is made.

    It is served to this machine alone, under the address with a token that is printed. Ctrl-C ends it.
    """
    import logging

    from cadpose.errors import DependencyError

    try:
        from cadpose.review.starting import ReviewOptions, run_review
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] not in ("fastapi", "starlette", "uvicorn"):
            raise
        raise DependencyError(
            f"the review page needs {error.name}, which is not installed: pip install 'cadpose[review]'"
        ) from None
    logging.getLogger("uvicorn").setLevel(logging.WARNING)
    options = ReviewOptions(
        store=store,
        photos=photos or (),
        library=library,
        author=author,
        host=host,
        port=port,
        allow_remote=allow_remote,
        device=device,
    )

    def tell(url: str) -> None:
        if json:
            print_json({"url": url})
        else:
            typer.echo(url)

    run_review(options, tell, complain, browser=not no_open)
