"""All that the page's requests share: one store, one library, the photos' folders, and what draws."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from platformdirs import user_data_dir

from cadpose import __version__
from cadpose.annotations.store import Author, Store, StoredAnnotation
from cadpose.errors import InputError
from cadpose.records import Annotation, Photo
from cadpose.review.jobs import Jobs
from cadpose.review.kept import Kept, KeptPictures
from cadpose.review.models import Models
from cadpose.review.photo_files import PhotoFiles
from cadpose.review.refusals import RefusedError, not_found
from cadpose.review.studio import Studio
from cadpose.review.turns import Slow

#: Decoded photos and encoded pictures that stay in memory, bytes.
PHOTO_BYTES, PICTURE_BYTES = 512 * 2**20, 128 * 2**20
_WRITE_PATIENCE = 30.0
#: Seconds that opening an annotation waits for a moved photo to be found.
_FIND_PATIENCE = 1.5


@dataclass(eq=False)
class Desk:
    """Everything behind the API.

    Attributes:
        store: The store.
        url: Its URL.
        models: The CAD library.
        photos: Finds the photos' files.
        studio: Refines and measures.
        jobs: Photos that are annotated.
        author: Who decides where a request does not say.
        pictures: Encoded pictures that are kept.
        slow: Marks what takes long.
    """

    store: Store
    url: str
    models: Models
    photos: PhotoFiles
    studio: Studio
    jobs: Jobs
    author: str
    pictures: KeptPictures = field(default_factory=lambda: KeptPictures(PICTURE_BYTES))
    slow: Slow = field(default_factory=Slow)
    _decoded: Kept[Photo] = field(
        default_factory=lambda: Kept(PHOTO_BYTES, lambda photo: photo.rgb.nbytes), init=False
    )
    _writing: threading.Lock = field(default_factory=threading.Lock, init=False)

    def photo_name(self, sha256: str) -> str:
        """The name of a photo of the store.

        Raises:
            RefusedError: it holds none with that digest.
        """
        found = self.store.photo(sha256)
        if found is None:
            raise not_found("the store holds no such photo")
        return found.name

    def photo(self, sha256: str, name: str) -> Photo:
        """A decoded photo, kept in memory for a while.

        Raises:
            InputError: it is not at hand.
        """
        return self._decoded.made(sha256, lambda: self.photos.read(sha256, name))

    def at_hand(self, sha256: str, name: str) -> bool:
        """Whether a photo's file can be read, as far as is known."""
        if self._decoded.get(sha256) is not None:
            return True
        return self.photos.path(sha256, name, patience=_FIND_PATIENCE) is not None

    def stored(self, annotation_id: str, *, original: bool = False) -> StoredAnnotation:
        """One annotation.

        Raises:
            RefusedError: there is none.
        """
        found = self.store.stored(annotation_id, original=original)
        if found is None:
            raise not_found("the store holds no such annotation")
        return found

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Writers of this server take turns: waiting here costs nothing, in SQLite it polls."""
        if not self._writing.acquire(timeout=_WRITE_PATIENCE):
            raise RefusedError("busy", "the store is being written by others: try again in a moment")
        try:
            yield
        finally:
            self._writing.release()

    def person(self, name: str) -> Author:
        """A person who decides on the page.

        Raises:
            InputError: the name is empty.
        """
        told = " ".join("".join(c if c.isprintable() else " " for c in name).split()) or self.author
        try:
            return Author(told, "human", "cadpose review", __version__)
        except ValueError as error:
            raise InputError(str(error)) from None


def photo_of(annotation: Annotation) -> tuple[str, str]:
    """Digest and name of an annotation's photo."""
    return annotation.photo_sha256, annotation.photo_name


def photo_folders(store_file: Path | None, told: Sequence[Path]) -> tuple[list[Path], Path]:
    """Folders in which photos may be read, and the one among them for uploads.

    Beside the store's file unless told; photos for a store on a server go into the user's data folder.
    """
    if store_file is None:
        uploads = Path(user_data_dir("cadpose")) / "photos"
        return [*told, uploads], uploads
    uploads = store_file.with_name(store_file.name + ".photos")
    return [*(told or [store_file.parent]), uploads], uploads
