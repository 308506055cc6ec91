"""A review server within the test's own process, on a store of made-up annotations."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient

from cadpose.annotations.store import Selection, Store
from cadpose.library.catalogue import Library
from cadpose.review.app import make_app
from cadpose.review.desk import Desk, photo_folders
from cadpose.review.jobs import Jobs
from cadpose.review.models import Models
from cadpose.review.photo_files import PhotoFiles
from cadpose.review.security import Access, allowed_hosts
from cadpose.review.studio import Studio
from cadpose.review.waiting import WaitingNotes
from tests.annotations.formats.made import Made

PORT = 8123
ORIGIN = f"http://127.0.0.1:{PORT}"
TOKEN = "a-token-of-this-test"


def access() -> Access:
    return Access(TOKEN, allowed_hosts(("127.0.0.1", "localhost", "::1"), PORT), f"cadpose_review_{PORT}")


@dataclass(eq=False)
class Served:
    """A server and its client, which has the cookie and tells its Origin."""

    desk: Desk
    client: TestClient
    url: str

    def get(self, path: str, status: int = 200) -> Any:
        answer = self.client.get(path)
        assert answer.status_code == status, answer.text
        return answer.json()

    def post(self, path: str, body: Any = None, status: int = 200) -> Any:
        answer = self.client.post(path, json=body)
        assert answer.status_code == status, answer.text
        return answer.json()

    def ids(self) -> list[str]:
        """Keys of all annotations, in the order of the queue."""
        return [item.annotation_id for item in self.desk.store.queue(Selection(), limit=1000).items]

    def close(self) -> None:
        self.client.close()
        self.desk.jobs.stop()
        self.desk.store.close()


def no_annotator() -> Any:
    raise AssertionError("this test annotates nothing")


def serve(
    folder: Path,
    library: Library | None,
    made: Made | None = None,
    *,
    photos: list[Path] | None = None,
    annotator: Any = no_annotator,
    raising: bool = True,
    url: str = "",
) -> Served:
    """Serve a new store, in ``folder`` unless told, that holds the made documents."""
    file = folder / "review.db"
    url = url or f"sqlite:///{file}"
    store = Store(url)
    if made is not None:
        store.add_many(made.documents)
    folders, uploads = photo_folders(file, photos if photos is not None else [made.folder] if made else [])
    desk = Desk(
        store=store,
        url=url,
        models=Models(library, "There is no CAD library."),
        photos=PhotoFiles(folders, uploads),
        studio=Studio(),
        jobs=Jobs(store, annotator, WaitingNotes(uploads)),
        author="Ada",
    )
    client = TestClient(make_app(desk, access()), base_url=ORIGIN, raise_server_exceptions=raising)
    client.headers["origin"] = ORIGIN
    client.cookies.set(f"cadpose_review_{PORT}", access().cookie_value)
    return Served(desk, client, url)


def digest(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
