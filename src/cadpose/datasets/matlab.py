"""MATLAB's .mat files (version 5) as plain Python values; needs SciPy, the extra ``datasets``."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path
from typing import Any, cast

import numpy as np

from cadpose.datasets.files import first_line, read_bytes
from cadpose.errors import DependencyError, InputError

#: Largest file and largest content that are read: annotations of one photo take some kB.
MAX_BYTES = 4 * 2**20
MAX_UNPACKED = 64 * 2**20
MAX_DEPTH = 12
#: A number takes a byte in the file and some thirty in memory: so many values, fields and texts are kept.
MAX_VALUES = 1_000_000
_HEADER = 128
_COMPRESSED = 15


def read_struct(path: Path, name: str) -> dict[str, Any]:
    """One struct variable of a .mat file.

    Structs become dicts, struct arrays and cells lists, text str, numbers a flat list of float. Values that
    are none of these become None.

    Raises:
        DependencyError: SciPy is missing.
        InputError: the file cannot be read, is too large or no .mat file, or holds no such struct.
    """
    try:
        from scipy.io import loadmat
    except ImportError as error:
        raise DependencyError("reading .mat files needs SciPy: pip install 'cadpose[datasets]'") from error
    data = _unpacked(read_bytes(path, MAX_BYTES), path)
    try:
        found = loadmat(cast(Any, io.BytesIO(data)), variable_names=[name], chars_as_strings=True)
        value = _Plain().of(found.get(name))
    except NotImplementedError as error:
        raise InputError(f"{path}: is a .mat file of version 7.3, save it as version 7") from error
    except MemoryError as error:
        raise InputError(f"{path}: tells of an array that does not fit into memory") from error
    except Exception as error:  # SciPy's reader raises anything at all on hostile bytes
        raise InputError(f"{path}: is not a .mat file that can be read ({first_line(error)})") from error
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds no struct {name!r}")
    return value


class _Plain:
    """SciPy's arrays to plain values, counted."""

    def __init__(self) -> None:
        self.left = MAX_VALUES

    def of(self, value: Any, depth: int = 0) -> Any:
        if depth > MAX_DEPTH:
            raise ValueError("nested too deeply")
        if not isinstance(value, np.ndarray):
            return None
        self.left -= value.size * max(1, len(value.dtype.names or ()))
        if self.left < 0:
            raise ValueError(f"more than {MAX_VALUES} values")
        if value.dtype.names is not None:
            names = value.dtype.names
            return [{name: self.of(item[name], depth + 1) for name in names} for item in value.ravel()]
        if value.dtype.kind == "U":
            return "".join(str(item) for item in value.ravel())
        if value.dtype.kind == "O":
            return [self.of(item, depth + 1) for item in value.ravel()]
        if value.dtype.kind in "buif":
            return [float(item) for item in value.ravel()]
        return None


def _unpacked(data: bytes, path: Path) -> bytes:
    """The file with its compressed elements unpacked, never more than ``MAX_UNPACKED`` bytes."""
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise InputError(f"{path}: is not a .mat file of version 5 to 7.3")
    if data[124:126] in (b"\x00\x02", b"\x02\x00"):
        raise InputError(f"{path}: is a .mat file of version 7.3, save it as version 7")
    out, position = bytearray(data[:_HEADER]), _HEADER
    while position + 8 <= len(data):
        kind, size = struct.unpack_from(f"{order}II", data, position)
        body = data[position + 8 : position + 8 + size]
        if kind == _COMPRESSED:
            inflater = zlib.decompressobj()
            try:
                out += inflater.decompress(body, MAX_UNPACKED - len(out) + 1)
            except zlib.error as error:
                raise InputError(f"{path}: is damaged ({error}), get a whole copy") from error
        else:
            out += data[position : position + 8 + size + -size % 8]
        if len(out) > MAX_UNPACKED:
            raise InputError(f"{path}: unpacks to more than {MAX_UNPACKED >> 20} MiB")
        # Compressed elements are not padded to eight bytes, others are.
        position += 8 + size + (0 if kind == _COMPRESSED else -size % 8)
    return bytes(out)
