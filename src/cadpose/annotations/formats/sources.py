"""What an export reads: documents of a store or a folder, the photos, and the library."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from sqlalchemy import make_url
from sqlalchemy.exc import ArgumentError

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.target import portable_name
from cadpose.annotations.parts import CadPart
from cadpose.annotations.store import UNDECIDED, Store
from cadpose.errors import InputError
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.photos import read_photo
from cadpose.records import Photo

#: What a document's first characters hold, wherever its keys stand.
_MARK = '"cadpose.annotation/'


@dataclass(frozen=True, eq=False)
class Sources:
    """What a writer may use beside the documents.

    Attributes:
        library_path: The CAD library; None for the user's.
        photos: Folder of the photos; None where none was named.
        photo_camera: Poses in the camera that took the photo, where the annotation knows it.
    """

    library_path: Path | None = None
    photos: Path | None = None
    photo_camera: bool = False
    _known: dict[str, str] = field(default_factory=dict, init=False, repr=False)

    @cached_property
    def library(self) -> Library:
        """The library, opened when a format first asks for a model.

        Raises:
            LibraryError: it is not there.
        """
        return Library.open(self.library_path)

    def mesh(self, cad: CadPart) -> Mesh:
        """The model that an annotation names.

        Raises:
            LibraryError: the library lacks it.
            InputError: the library's model of that id is another one.
        """
        held = self.library.get(cad.id)
        if cad.sha256 and held.sha256 != cad.sha256:
            raise InputError(
                f"the library's model {cad.id} is not the one that was annotated, so its poses may not fit: "
                "name the library of that run with --library, or annotate again"
            )
        return self.library.mesh(held)

    def photo_path(self, document: AnnotationDocument) -> Path:
        """The photo's file, found below ``photos`` by as much of its recorded path as is there.

        Raises:
            InputError: no folder was named, or it holds no such photo.
        """
        if self.photos is None:
            raise InputError("this format holds the photos themselves: name their folder with --photos")
        pieces = portable_name(document.photo.name).split("/")
        for start in range(len(pieces)):
            path = self.photos.joinpath(*pieces[start:])
            if path.is_file():
                return path
        raise InputError(f"{document.photo.name} is not in {self.photos}: name its folder with --photos")

    def photo(self, document: AnnotationDocument) -> Photo:
        """The decoded photo, the very one that was annotated.

        Raises:
            InputError: it is not there, cannot be used, or has other bytes.
        """
        path = self.photo_path(document)
        photo = read_photo(path)
        if photo.sha256 != document.photo.sha256:
            raise InputError(
                f"{path} is not the photo that was annotated under that name (its SHA-256 differs): "
                "name the folder of the right one with --photos"
            )
        return photo


def documents_of_store(url: str, verdicts: Sequence[str] = ()) -> Iterator[AnnotationDocument]:
    """The documents of a store, one in memory at a time; it is only read.

    With verdicts, photos without such an annotation are left out, and all failures, since a failure has none.

    Args:
        url: The store's.
        verdicts: What holds now, by person or program: any of these. Unless told, all but what a person
            rejected.

    Raises:
        InputError: there is no such file, or an unknown verdict.
        CadposeError: the store cannot be read, or an earlier version made it.
    """
    place = store_file(url)
    if place is not None and not place.is_file():
        raise InputError(f"there is no store {place}: name one that `cadpose annotate --store` made")
    with Store(url, create=False, migrate=False) as store:
        for document in store.iter_documents(verdicts=tuple(verdicts), rejected=bool(verdicts)):
            if not verdicts:
                yield document
            elif document.annotations:
                yield document.model_copy(update={"failures": ()})


def store_file(url: str) -> Path | None:
    """The file of an SQLite store, None for stores of other kinds.

    Raises:
        InputError: it is no database URL.
    """
    try:
        told = make_url(url)
    except (ArgumentError, ValueError):
        # It may hold a password, and where is unknown: it is not shown.
        raise InputError("the store's URL is not a database URL: write it as sqlite:///file.db") from None
    place = told.database
    return Path(place) if told.drivername.startswith("sqlite") and place and place != ":memory:" else None


def documents_in(paths: Sequence[Path]) -> Iterator[AnnotationDocument]:
    """Documents from files, and from folders those of their .json files that are documents, by name.

    Raises:
        InputError: a file cannot be read or is no document, or a folder holds none.
    """
    for path in paths:
        if not path.is_dir():
            yield _document(path)
            continue
        names = sorted(entry.name for entry in os.scandir(path) if _is_json(entry))
        found = False
        for name in names:
            if _is_document(path / name):
                found = True
                yield _document(path / name)
        if not found:
            raise InputError(f"the folder {path} holds no annotation document: name another")


def chosen(
    documents: Iterable[AnnotationDocument], categories: Sequence[str] = (), verdicts: Sequence[str] = ()
) -> Iterator[AnnotationDocument]:
    """The documents with only annotations of some categories and verdicts; all where none is told.

    The verdicts are those that the documents tell (``"undecided"``: none), so the program's.

    With a choice, photos without any are left out, and so are failures of other categories, or all of them
    where verdicts are told, since a failure has none.
    """
    if not categories and not verdicts:
        yield from documents
        return

    def kept(part: AnnotationPart) -> bool:
        return (not categories or part.detection.category in categories) and (
            not verdicts or (part.verdict or UNDECIDED) in verdicts
        )

    for document in documents:
        parts = tuple(part for part in document.annotations if kept(part))
        failures = tuple(f for f in document.failures if not verdicts and f.detection.category in categories)
        if parts or failures:
            yield document.model_copy(update={"annotations": parts, "failures": failures})


def _is_json(entry: os.DirEntry[str]) -> bool:
    return entry.name.endswith(".json") and not entry.name.startswith(".") and entry.is_file()


def _is_document(path: Path) -> bool:
    try:
        with path.open(encoding="utf-8", errors="replace") as file:
            return _MARK in file.read(300)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): check its permissions") from error


def _document(path: Path) -> AnnotationDocument:
    # Looked at before it is opened: a pipe would wait for a writer.
    if not path.is_file():
        raise InputError(f"there is no file or folder {path}: name documents of `cadpose annotate`")
    return AnnotationDocument.read(path)
