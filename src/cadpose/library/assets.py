"""Where a mesh's side files (materials, textures, buffers) are read from: never outside their folder."""

from __future__ import annotations

import posixpath
import re
import zipfile
from pathlib import Path
from typing import Protocol
from urllib.parse import unquote

from cadpose.errors import InputError
from cadpose.library.limits import DEFAULT_LIMITS, MIB, Limits

_ABSOLUTE = re.compile(r"^([A-Za-z]:|/|~)")
_SCHEME = re.compile(r"^[A-Za-z][A-Za-z0-9+.-]+:")


class Assets(Protocol):
    """Reads files that a mesh names, relative to the mesh's own folder."""

    def read(self, name: str, limit: int) -> bytes | None:
        """The named file's bytes, or None where there is no such file.

        Raises:
            InputError: the name leads outside the allowed folder, or the file is larger than ``limit``.
        """
        ...


def contained_path(name: str, base: str, owner: str) -> str | None:
    """A name written in a mesh file, as a normal relative path below the assets' root.

    Args:
        name: As written, with ``/`` or ``\\`` between parts.
        base: The mesh's folder relative to the root, ``""`` where they are the same.
        owner: The mesh file's name, for the message.

    Returns:
        The path relative to the root; None for a web address. An absolute path is never followed: its
        last part is looked for beside the mesh, since exporters often leave their author's paths behind.

    Raises:
        InputError: the name leads out of the root by ``..``, or holds a NUL.
    """
    slashed = name.strip().strip('"').replace("\\", "/")
    if "\0" in slashed:
        raise InputError(f"{owner} names a file with a NUL byte in it; the model is refused.")
    if _ABSOLUTE.match(slashed):
        slashed = posixpath.basename(slashed)
    elif _SCHEME.match(slashed):
        return None
    path = posixpath.normpath(posixpath.join(base, slashed))
    if path == ".." or path.startswith("../"):
        raise InputError(
            f"{owner} refers to {name!r}, which lies outside the model's folder; "
            "copy that file beside the model and mend the reference."
        )
    return path


class FolderAssets:
    """Files on disk, below ``root``; symbolic links that lead out of it count as outside.

    Args:
        mesh_path: The mesh file; names are relative to its folder.
        root: Nothing outside this folder is read, the mesh included; the mesh's own folder by default.

    Raises:
        InputError: the mesh is a link out of ``root``.
    """

    def __init__(self, mesh_path: Path, root: Path | None = None) -> None:
        self._root = (root or mesh_path.parent).resolve()
        # A mesh named by itself may be a link: whoever named it meant it.
        place = (mesh_path.resolve() if root is not None else mesh_path).parent.resolve()
        if not place.is_relative_to(self._root):
            raise InputError(f"{mesh_path} is a link out of {self._root}: copy the file there.")
        self._base = place.relative_to(self._root).as_posix()
        self._owner = mesh_path.name
        self._base = "" if self._base == "." else self._base

    def read(self, name: str, limit: int) -> bytes | None:
        """See `Assets.read`."""
        for spelling in dict.fromkeys((name, unquote(name))):
            relative = contained_path(spelling, self._base, self._owner)
            found = self._find(relative) if relative else None
            if found is not None:
                return read_capped(found, limit)
        return None

    def _find(self, relative: str) -> Path | None:
        path = self._root / relative
        if not path.is_file():
            # Models made on Windows often differ in case from what they name.
            folder = path.parent
            if not folder.is_dir():
                return None
            same = [p for p in folder.iterdir() if p.name.lower() == path.name.lower() and p.is_file()]
            if not same:
                return None
            path = min(same)
        resolved = path.resolve()
        if not resolved.is_relative_to(self._root):
            raise InputError(f"{self._owner} refers to {relative!r}, a link out of the model's folder.")
        return resolved


class ZipAssets:
    """Files of an opened archive, below the folder of one of its entries."""

    def __init__(self, archive: Archive, member: str) -> None:
        self._archive = archive
        self._member = member
        self._base = posixpath.dirname(member)

    def read(self, name: str, limit: int) -> bytes | None:
        """See `Assets.read`."""
        for spelling in dict.fromkeys((name, unquote(name))):
            relative = contained_path(spelling, self._base, self._member)
            if relative is None:
                continue
            entry = self._archive.find(relative)
            if entry is not None:
                return self._archive.read(entry, limit)
        return None


class Archive:
    """A zip file whose table of contents was judged before anything is unpacked.

    Raises:
        InputError: it is not a zip file, or its entries are too many, too large, too dense or encrypted.
    """

    def __init__(self, path: Path, limits: Limits = DEFAULT_LIMITS) -> None:
        self.path = path
        try:
            self._zip = zipfile.ZipFile(path)
        except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError) as error:
            raise InputError(f"{path} cannot be opened as an archive ({error}).") from error
        infos = self._zip.infolist()
        if len(infos) > limits.archive_entries:
            raise InputError(
                f"{path} holds {len(infos)} files, more than the {limits.archive_entries} allowed."
            )
        total = sum(i.file_size for i in infos)
        if total > limits.archive_bytes:
            raise InputError(
                f"{path} would unpack to {total // MIB} MiB, "
                f"more than the {limits.archive_bytes // MIB} allowed."
            )
        if not all(info.filename for info in infos):
            raise InputError(f"{path} is damaged: one of its files has no name.")
        for info in infos:
            if info.file_size > MIB and info.file_size > limits.archive_ratio * max(info.compress_size, 1):
                raise InputError(
                    f"{path} is refused: {info.filename!r} unpacks to {info.file_size // MIB} MiB "
                    f"from {info.compress_size} bytes."
                )
        self._entries = {i.filename.replace("\\", "/").lstrip("/"): i for i in infos if not i.is_dir()}
        self._lower = {name.lower(): name for name in self._entries}

    def __enter__(self) -> Archive:
        return self

    def __exit__(self, *_: object) -> None:
        self._zip.close()

    def names(self) -> list[str]:
        """Every file's path in the archive, sorted."""
        return sorted(self._entries)

    def find(self, name: str) -> str | None:
        """The entry of that name, in any case, or None."""
        return name if name in self._entries else self._lower.get(name.lower())

    def checksum(self, name: str) -> str:
        """Size and CRC of an entry, as written in the archive's table."""
        info = self._entries[name]
        return f"{name}:{info.file_size}:{info.CRC:08x}"

    def read(self, name: str, limit: int) -> bytes:
        """One entry's bytes.

        Raises:
            InputError: it is larger than ``limit``, larger than it claimed, damaged or encrypted.
        """
        info = self._entries[name]
        if info.file_size > limit:
            raise InputError(
                f"{self.path}: {name} is {info.file_size // MIB} MiB, more than the {limit // MIB} allowed."
            )
        try:
            with self._zip.open(info) as stream:
                # One byte more than promised tells a header that lies.
                data = stream.read(info.file_size + 1)
        except (OSError, zipfile.BadZipFile, RuntimeError, NotImplementedError, EOFError) as error:
            raise InputError(f"{self.path}: {name} cannot be unpacked ({error}).") from error
        except Exception as error:  # zlib.error and lzma.LZMAError have no common base
            raise InputError(f"{self.path}: {name} is damaged ({error}).") from error
        if len(data) != info.file_size:
            raise InputError(f"{self.path}: {name} does not have the size its archive states.")
        return data


def read_capped(path: Path, limit: int) -> bytes:
    """A file's bytes.

    Raises:
        InputError: it cannot be read or is larger than ``limit``.
    """
    try:
        with path.open("rb") as stream:
            data = stream.read(limit + 1)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}).") from error
    if len(data) > limit:
        raise InputError(f"{path} is larger than the {limit // MIB} MiB allowed.")
    return data
