"""Where an export goes: written beside its place, flushed to disk, then moved in whole."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import output_paths
from cadpose.errors import InputError


def file_stem(document: AnnotationDocument) -> str:
    """A file name without its ending for what belongs to a photo; no photo's name can abuse it.

    Photos of one name from two folders differ by the digits of their SHA-256.
    """
    stem = output_paths([document.photo.name], Path())[0].json.stem
    return f"{stem}-{document.photo.sha256[:16]}"


def portable_name(name: str) -> str:
    """A photo's name as a relative path with forward slashes, without drive, root and dots."""
    pieces = [piece for piece in name.replace("\\", "/").split("/") if piece not in ("", ".", "..")]
    if len(pieces) > 1 and len(pieces[0]) == 2 and pieces[0][1] == ":":
        del pieces[0]
    return "/".join(pieces) or "photo"


@contextmanager
def new_file(out: Path, force: bool, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """A path to write to, moved to ``out`` when the block ends well; else no trace of it is left.

    Raises:
        InputError: ``out`` is a folder, is there already and ``force`` is false, or is an input.
    """
    if out.is_dir():
        raise InputError(f"{out} is a folder, and this format is one file: name a file with --out")
    if out.exists() and not force:
        raise InputError(f"{out} is there already: choose another --out, or replace it with --force")
    place = Path(os.path.realpath(out))
    for path in inputs:
        read = Path(os.path.realpath(path))
        if read == place:
            raise InputError(f"{out} is read by this export and would be written over: choose another --out")
    out.parent.mkdir(parents=True, exist_ok=True)
    # The ending stays the last, for libraries that go by it.
    beside = out.parent / f".cadpose-{secrets.token_hex(8)}.part{out.suffix}"
    try:
        yield beside
        with beside.open("rb") as file:
            os.fsync(file.fileno())
        beside.replace(out)
    finally:
        beside.unlink(missing_ok=True)


@contextmanager
def new_folder(out: Path, force: bool, inputs: Iterable[Path] = ()) -> Iterator[Path]:
    """A folder to fill, moved to ``out`` when the block ends well; else no trace of it is left.

    Raises:
        InputError: ``out`` is a file, holds something and ``force`` is false, or replacing it would take
            away what the export reads, or the folder in which the command runs.
    """
    if out.exists() and not out.is_dir():
        raise InputError(f"{out} is a file, and this format is a folder: name a folder with --out")
    filled = out.is_dir() and any(out.iterdir())
    if filled and not force:
        raise InputError(f"{out} is not empty: choose another --out, or replace all of it with --force")
    place = Path(os.path.realpath(out))
    if filled:
        for path in (*inputs, Path.cwd(), Path.home()):
            read = Path(os.path.realpath(path))
            if read == place or place in read.parents:
                raise InputError(f"{out} holds {path} and cannot be replaced: choose another --out")
    place.parent.mkdir(parents=True, exist_ok=True)
    token = secrets.token_hex(8)
    beside, old = (place.parent / f".cadpose-{token}.{kind}" for kind in ("part", "old"))
    beside.mkdir()
    try:
        yield beside
        _flush()
        if place.exists():
            place.rename(old)
        try:
            beside.rename(place)
        except OSError:
            if old.exists():
                old.rename(place)
            raise
    finally:
        shutil.rmtree(beside, ignore_errors=True)
        with suppress(FileNotFoundError):
            shutil.rmtree(old)


def _flush() -> None:
    # One call for thousands of small files; Windows has none.
    if hasattr(os, "sync"):
        os.sync()
