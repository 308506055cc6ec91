"""Writing outputs whole or not at all, and file names that no photo's name can abuse."""

from __future__ import annotations

import contextlib
import hashlib
import os
import re
import secrets
import unicodedata
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from cadpose.errors import CadposeError, InputError

#: Longest stem in bytes: file systems allow 255 for the whole name.
_STEM_BYTES = 120
_RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{i}" for port in ("com", "lpt") for i in range(1, 10))}


def write_atomic(path: str | os.PathLike[str], data: bytes, option: str = "--out") -> None:
    """Write ``data`` beside ``path``, fsync it and move it into place; parent folders are made.

    Whoever reads sees the old file or the whole new one, also after a crash. ``option`` is what the message
    of a failure tells the user to change.

    Raises:
        CadposeError: the file cannot be written; no trace of it is left.
    """
    target = Path(path)
    beside = write_beside(target, data, option)
    with told_as_unwritten(target, option):
        try:
            beside.replace(target)
        except BaseException:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise
        sync_folder(target.parent)


def write_beside(target: Path, data: bytes, option: str = "--out") -> Path:
    """Write ``data`` to a hidden file beside ``target`` and fsync it; parent folders are made.

    Raises:
        CadposeError: as of :func:`write_atomic`.
    """
    beside = target.parent / f".cadpose-{secrets.token_hex(8)}.part"
    with told_as_unwritten(target, option):
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            # Unlike tempfile's, this file gets the permissions that the user's umask gives.
            with beside.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
        except BaseException:
            with contextlib.suppress(OSError):
                beside.unlink()
            raise
    return beside


@contextlib.contextmanager
def told_as_unwritten(target: Path, option: str = "--out") -> Iterator[None]:
    """The system's errors inside become a CadposeError that names ``target`` and ``option``."""
    try:
        yield
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CadposeError(f"cannot write {target}: {reason}; choose another place with {option}") from None


def sync_folder(folder: Path) -> None:
    """A rename lasts only once its folder is on disk; Windows cannot open folders."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def spare_photos(
    targets: Iterable[str | os.PathLike[str]],
    photos: Iterable[str | os.PathLike[str]],
    option: str = "--out",
) -> None:
    """No output may take the place of a photo of the run: ``car.overlay.png`` beside ``car.jpg``.

    Places are compared, not spellings: neither ``photos/../photos`` nor a link hides a photo.

    Raises:
        InputError: a target is one of the photos.
    """
    places = {os.path.realpath(photo) for photo in photos}
    for target in targets:
        if os.path.realpath(target) in places:
            raise InputError(
                f"{target} is one of the photos and would be written over: choose another {option}"
            )


@dataclass(frozen=True, slots=True)
class OutputPaths:
    """Where the outputs of one photo go.

    Attributes:
        json: The document.
        overlay: The photo with its models drawn over it.
        candidates: The candidate strips.
        card: One HTML page with all of it.
        thumbnail: The overlay made small, for the pages of the run.
        failed: Why the photo failed, in place of all the others.
    """

    json: Path
    overlay: Path
    candidates: Path
    card: Path
    thumbnail: Path
    failed: Path

    @property
    def stem(self) -> str:
        """What the names of all of them begin with."""
        return self.json.name.removesuffix(".json")

    def pictures(self) -> tuple[Path, ...]:
        """What is drawn, in the order in which it is written; the document follows."""
        return self.overlay, self.candidates, self.card, self.thumbnail

    def results(self) -> tuple[Path, ...]:
        """The document and the pictures: what a photo that is done has."""
        return self.json, *self.pictures()

    def all(self) -> tuple[Path, ...]:
        """Every one of them."""
        return *self.results(), self.failed


def output_paths(
    photos: Iterable[str | os.PathLike[str]],
    folder: str | os.PathLike[str],
    belongs_to_another: Callable[[Path, Path], bool] = lambda photo, document: False,
) -> list[OutputPaths]:
    """Paths in ``folder`` for every photo of a run, in order.

    A photo keeps its stem (``a/car.jpg`` gives ``car.json``). Photos of the run whose stems agree, upper
    and lower case being the same, get eight digits of their path's SHA-256 as well, so the names depend
    on the set of photos but not on its order; so does one whose document would have the name of another's
    ``failed``. The same path given twice gets the same outputs.

    Args:
        photos: Their paths.
        folder: Where the outputs will lie.
        belongs_to_another: Told a photo and the document that would be its own, whether an earlier run
            wrote that for another photo; the photo then gets the digits too.
    """
    paths = [Path(photo) for photo in photos]
    names = [os.path.normpath(path) for path in paths]
    given = dict(zip(names, paths, strict=True))
    out = Path(folder)
    shared = Counter(_safe_stem(name).casefold() for name in given)
    crowded = {
        name
        for name, photo in given.items()
        if shared[(stem := _safe_stem(name)).casefold()] > 1
        or stem.casefold().endswith(".failed")
        or belongs_to_another(photo, out / f"{stem}.json")
    }
    chosen: dict[str, str] = {}
    taken: set[str] = set()
    for name in sorted(given, key=lambda n: (n in crowded, n)):
        stem = _safe_stem(name)
        if name in crowded:
            digest = hashlib.sha256(name.encode(errors="surrogateescape")).hexdigest()
            stem, plain, digits = f"{stem}-{digest[:8]}", stem, 8
            while stem.casefold() in taken:
                digits += 1
                stem = f"{plain}-{digest[:digits]}"
        taken.add(stem.casefold())
        chosen[name] = stem
    return [
        OutputPaths(
            json=out / f"{stem}.json",
            overlay=out / f"{stem}.overlay.png",
            candidates=out / f"{stem}.candidates.png",
            card=out / f"{stem}.card.html",
            thumbnail=out / "thumbnails" / f"{stem}.jpg",
            failed=out / f"{stem}.failed.json",
        )
        for stem in (chosen[name] for name in names)
    ]


def _safe_stem(name: str) -> str:
    """Letters, digits and ``. _ + -`` of the file's stem; no hidden, reserved or overlong name."""
    base = re.split(r"[/\\]", name)[-1]
    stem = base.rsplit(".", 1)[0] if "." in base.lstrip(".") else base
    text = unicodedata.normalize("NFC", stem.encode(errors="replace").decode())
    text = re.sub(r"[^\w.+-]+", "_", text).strip("._-")
    text = text.encode()[:_STEM_BYTES].decode(errors="ignore")
    if not text:
        return "photo"
    return f"{text}_" if text.casefold().split(".")[0] in _RESERVED else text
