"""From the command line's words to a server that runs."""

from __future__ import annotations

import getpass
import threading
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from cadpose.annotations.formats.sources import store_file
from cadpose.annotations.store import Store
from cadpose.batch.job import AnnotatorOptions
from cadpose.errors import InputError, LibraryError
from cadpose.library.catalogue import Library
from cadpose.review.app import make_app
from cadpose.review.desk import PICTURE_BYTES, Desk, photo_folders
from cadpose.review.jobs import Jobs
from cadpose.review.kept import KeptPictures
from cadpose.review.models import Models
from cadpose.review.photo_files import PhotoFiles
from cadpose.review.server import is_loopback, open_socket, serve
from cadpose.review.studio import Studio
from cadpose.review.uploads import sweep_parts
from cadpose.review.waiting import WaitingNotes
from cadpose.weights import cache_folder


@dataclass(frozen=True)
class ReviewOptions:
    """What the command line tells.

    Attributes:
        store: URL of the store; made where there is none.
        photos: Folders in which photos may be read.
        library: Its folder; None for the user's.
        author: Who decides; None for the user's name.
        host: Address to serve on.
        port: Port; 0 for a free one.
        allow_remote: Whether the host may be reached by other machines.
        device: ``"cpu"`` or ``"cuda"``.
    """

    store: str
    photos: Sequence[Path] = ()
    library: Path | None = None
    author: str | None = None
    host: str = "127.0.0.1"
    port: int = 0
    allow_remote: bool = False
    device: str = "cpu"


def open_desk(options: ReviewOptions) -> Desk:
    """Open the store, the library if there is one, and the photos' folders.

    Raises:
        InputError: a folder is missing, or the store would be gone with the server.
        CadposeError: the store cannot be opened or made.
        LibraryError: the library that was named cannot be opened.
    """
    for folder in options.photos:
        if not folder.is_dir():
            raise InputError(f"there is no folder {folder}: name the photos' own with --photos")
    file = store_file(options.store)
    if file is None and options.store.startswith("sqlite"):
        raise InputError("a store in memory would be gone with the page: write it as sqlite:///file.db")
    try:
        library, why = Library.open(options.library), ""
    except LibraryError as error:
        if options.library is not None:
            raise
        # Without models there is still a queue to look through.
        library, why = None, str(error)
    folders, uploads = photo_folders(file, options.photos)
    sweep_parts(uploads)
    store = Store(options.store)
    annotator = AnnotatorOptions(library=options.library, device=options.device)
    return Desk(
        store=store,
        url=options.store,
        models=Models(library, why),
        photos=PhotoFiles(folders, uploads),
        studio=Studio(options.device),
        jobs=Jobs(store, annotator.make, WaitingNotes(uploads)),
        author=(options.author or _user()).strip() or "somebody",
        pictures=KeptPictures(PICTURE_BYTES, cache_folder() / "review"),
    )


def run_review(
    options: ReviewOptions, tell: Callable[[str], None], warn: Callable[[str], None], browser: bool = False
) -> None:
    """Serve the page until it is stopped.

    Args:
        options: What was told.
        tell: Called with the address once requests are answered.
        warn: Called with sentences for the user.
        browser: Whether to open the address in the user's browser.

    Raises:
        CadposeError: it cannot be started; one sentence.
        KeyboardInterrupt: it was stopped by Ctrl-C.
    """
    if not is_loopback(options.host):
        if not options.allow_remote:
            raise InputError(
                f"{options.host} can be reached from other machines, and the connection is not encrypted: "
                "add --allow-remote if that is meant"
            )
        warn(
            f"serving on {options.host}: whoever on the network has the address with its token can read and "
            "decide, and the connection is not encrypted"
        )
    opened = open_socket(options.host, options.port)
    try:
        desk = open_desk(options)
    except BaseException:
        opened.listener.close()
        raise
    if desk.models.why:
        warn(desk.models.why)
    if not desk.store.revision_found:
        warn(f"a new, empty store was made: {desk.store.place}")

    def up() -> None:
        tell(opened.url)
        if desk.models.library is not None:
            # Files are read for it, and the page need not wait.
            threading.Thread(target=go_on, args=(desk,), name="resume", daemon=True).start()
        if browser:
            threading.Thread(target=webbrowser.open, args=(opened.url,), daemon=True).start()

    try:
        serve(make_app(desk, opened.access), opened, up)
    finally:
        desk.jobs.stop()
        desk.store.close()


def go_on(desk: Desk) -> None:
    """Take up the photos that an earlier start left waiting."""
    desk.jobs.resume(lambda sha256, name: desk.photos.path(sha256, name, walk=False))


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return ""
