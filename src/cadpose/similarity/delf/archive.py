"""Chosen files of a .tar.gz, or of the folder it was unpacked to, as bytes: nothing is written to disk.

So a member's path cannot lead anywhere; links and devices are not read, and sizes are bounded.
"""

from __future__ import annotations

import gzip
import io
import re
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from cadpose.errors import InputError

#: Largest archive, and most bytes that it may unpack to; DELF's have some 100 MB.
MAX_PACKED = 256 * 2**20
MAX_UNPACKED = 512 * 2**20
MAX_MEMBERS = 10_000


def read_files(path: Path, pattern: str, most_bytes: int) -> dict[str, bytes]:
    """Regular files whose path ends with the pattern, by that ending.

    Args:
        path: A .tar.gz archive or a folder.
        pattern: Regular expression that the ending must match from some path separator on.
        most_bytes: Largest size of one file; all together may have ``MAX_UNPACKED``.

    Raises:
        InputError: it cannot be read, is damaged, has too much in it, a sparse file of such an ending, or two
            files of one ending.
    """
    ending = re.compile(rf"(?:.*/)?({pattern})")
    found: dict[str, bytes] = {}
    left = MAX_UNPACKED
    try:
        for name, size, stream in _folder(path) if path.is_dir() else _archive(path):
            match = ending.fullmatch(name)
            if match is None:
                continue
            if size > most_bytes:
                raise InputError(f"{path}: {match[1]} has more than {most_bytes >> 20} MiB")
            left -= size
            if left < 0:
                raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED >> 20} MiB")
            if stream is None:
                raise InputError(f"{path}: {match[1]} is a sparse file, pack the archive without --sparse")
            if match[1] in found:
                raise InputError(f"{path}: holds {match[1]} twice")
            found[match[1]] = stream.read(most_bytes)
            if len(found[match[1]]) != size:
                raise InputError(f"{path}: ends within {match[1]}, fetch it again")
    # tarfile lets a ValueError through where a number of a PAX header is none.
    except (tarfile.TarError, EOFError, zlib.error, gzip.BadGzipFile, ValueError) as error:
        raise InputError(f"{path}: is no .tar.gz archive, or damaged ({error}); fetch it again") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    return found


def _folder(path: Path) -> Iterator[tuple[str, int, IO[bytes]]]:
    for count, file in enumerate(sorted(path.rglob("*"))):
        if count >= MAX_MEMBERS:
            raise InputError(
                f"{path}: holds more than {MAX_MEMBERS} files, name the unpacked archive's folder"
            )
        if file.is_file():
            with file.open("rb") as stream:
                yield file.relative_to(path).as_posix(), file.stat().st_size, stream


def _archive(path: Path) -> Iterator[tuple[str, int, IO[bytes] | None]]:
    """Name, size and content; None for a sparse file, whose size is not that of what is packed."""
    if path.stat().st_size > MAX_PACKED:
        raise InputError(f"{path}: larger than {MAX_PACKED >> 20} MiB, which no such archive is")
    # A stream, which never seeks: all that is unpacked is counted.
    with (
        gzip.open(path, "rb") as packed,
        tarfile.open(fileobj=io.BufferedReader(_Bounded(packed, path)), mode="r|") as archive,
    ):
        for count, member in enumerate(archive):
            if count >= MAX_MEMBERS:
                raise InputError(f"{path}: holds more than {MAX_MEMBERS} files")
            if member.issparse():
                yield member.name, member.size, None
            elif member.isreg() and (stream := archive.extractfile(member)) is not None:
                yield member.name, member.size, stream


class _Bounded(io.RawIOBase):
    """A stream that refuses to give more than ``MAX_UNPACKED`` bytes."""

    def __init__(self, stream: gzip.GzipFile, path: Path) -> None:
        self.stream = stream
        self.path = path
        self.given = 0

    def readable(self) -> bool:
        """Yes."""
        return True

    def readinto(self, buffer: Any) -> int:
        """Some bytes into the buffer."""
        count = self.stream.readinto(buffer)
        self.given += count
        if self.given > MAX_UNPACKED:
            raise InputError(f"{self.path}: unpacks to more than {MAX_UNPACKED >> 20} MiB")
        return count
