"""MATLAB's .mat files (version 5 to 7) as plain Python values.

SciPy's reader ends the process on some damaged files, so annotation files of strangers are read here, where
every length is checked against what is left. The format is told in MathWorks' "MAT-File Format" (R2024a):
elements of a type, a size and bytes; an array is an element of elements, and a struct one of arrays.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.datasets.files import first_line, read_bytes
from cadpose.errors import InputError

#: Largest file and largest content that are read: annotations of one photo take some kB.
MAX_BYTES = 4 * 2**20
MAX_UNPACKED = 64 * 2**20
MAX_DEPTH = 12
#: A number takes a byte in the file and some thirty in memory: so many values, fields and texts are kept.
MAX_VALUES = 1_000_000
#: Fields of one struct.
MAX_FIELDS = 1000
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
#: Types of numbers, by their code.
_NUMBERS = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
#: Encodings of text, where it is not kept as numbers.
_TEXTS = {16: "utf-8", 17: "utf-16", 18: "utf-32"}
#: Classes of arrays.
_CELL, _STRUCT, _OBJECT, _CHAR, _FIRST_NUMBER, _LAST_NUMBER = 1, 2, 3, 4, 6, 15


def read_struct(path: Path, name: str) -> dict[str, Any]:
    """One struct variable of a .mat file.

    Structs become dicts, struct arrays and cells lists, text str, numbers a flat list of float, row by row.
    Values that are none of these become None.

    Raises:
        InputError: the file cannot be read, is too large or no .mat file, or holds no such struct.
    """
    order, data = _unpacked(read_bytes(path, MAX_BYTES), path)
    try:
        reader = _Reader(order)
        value = reader.variable(_Bytes(data), name)
    except (ValueError, struct.error, OverflowError) as error:
        raise InputError(f"{path}: is not a .mat file that can be read ({first_line(error)})") from error
    if isinstance(value, list) and len(value) == 1:
        value = value[0]
    if not isinstance(value, dict):
        raise InputError(f"{path}: holds no struct {name!r}")
    return value


@dataclass
class _Bytes:
    """Bytes that are taken from the front."""

    data: memoryview
    at: int = 0

    def take(self, count: int) -> memoryview:
        """The next bytes.

        Raises:
            ValueError: so many are not left.
        """
        if count < 0 or count > len(self.data) - self.at:
            raise ValueError("it ends too early")
        self.at += count
        return self.data[self.at - count : self.at]

    @property
    def left(self) -> int:
        """How many."""
        return len(self.data) - self.at


class _Reader:
    """Reads elements; counts the values that it makes of them."""

    def __init__(self, order: str) -> None:
        self.order, self.room = order, MAX_VALUES

    def variable(self, data: _Bytes, name: str) -> Any:
        """The value of the variable of that name, None where there is none."""
        while data.left >= 8:
            kind, body = self.element(data)
            if kind == _MATRIX:
                inner = _Bytes(body)
                head = self.head(inner)
                if head is not None and head[2] == name:
                    return self.value(head[0], head[1], inner, 0)
        return None

    def element(self, data: _Bytes) -> tuple[int, memoryview]:
        """Type and bytes of the next element."""
        kind, size = struct.unpack(f"{self.order}II", data.take(8))
        if kind >> 16:  # a small one holds up to four bytes in the place of its size
            kind, size = kind & 0xFFFF, kind >> 16
            if size > 4:
                raise ValueError("a small element is too large")
            return kind, data.data[data.at - 4 : data.at - 4 + size]
        body = data.take(size)
        data.take(min(-size % 8, data.left))
        return kind, body

    def head(self, data: _Bytes) -> tuple[int, tuple[int, ...], str] | None:
        """Class, shape and name of an array; None of an empty element."""
        if not data.left:
            return None
        _, flags = self.element(data)
        (word,) = struct.unpack(f"{self.order}I", flags[:4])
        _, sizes = self.element(data)
        shape = tuple(int(n) for n in np.frombuffer(sizes, f"{self.order}i4"))
        if not 2 <= len(shape) <= 8 or min(shape) < 0:
            raise ValueError("an array has no shape")
        _, name = self.element(data)
        return word & 0xFF, shape, bytes(name).decode("latin-1")

    def value(self, kind: int, shape: tuple[int, ...], data: _Bytes, depth: int) -> Any:
        """What an array holds."""
        count = 1
        for side in shape:
            count *= side
        if kind == _CELL:
            self.spend(count)
            return _by_rows([self.array(data, depth + 1) for _ in range(count)], shape)
        if kind in (_STRUCT, _OBJECT):
            if kind == _OBJECT:
                self.element(data)  # the name of its class
            names = self.fields(data)
            self.spend(count * max(1, len(names)))
            return _by_rows(
                [{name: self.array(data, depth + 1) for name in names} for _ in range(count)], shape
            )
        if kind == _CHAR:
            return self.text(data, shape)
        if _FIRST_NUMBER <= kind <= _LAST_NUMBER:
            return _by_rows([float(number) for number in self.numbers(data, count)], shape)
        return None

    def array(self, data: _Bytes, depth: int) -> Any:
        """The array that comes next."""
        if depth > MAX_DEPTH:
            raise ValueError("nested too deeply")
        kind, body = self.element(data)
        if kind != _MATRIX:
            raise ValueError("an array is missing")
        inner = _Bytes(body)
        head = self.head(inner)
        return [] if head is None else self.value(head[0], head[1], inner, depth)

    def fields(self, data: _Bytes) -> list[str]:
        """The names of a struct's fields."""
        _, length = self.element(data)
        (each,) = struct.unpack(f"{self.order}i", length[:4])
        _, text = self.element(data)
        if not 1 <= each <= 64:
            raise ValueError("a struct's fields have no names")
        if len(text) > MAX_FIELDS * each:
            raise ValueError(f"a struct has more than {MAX_FIELDS} fields")
        self.spend(len(text) // each)
        pieces = [bytes(text[i : i + each]) for i in range(0, len(text) - each + 1, each)]
        return [piece.partition(b"\0")[0].decode("latin-1") for piece in pieces]

    def numbers(self, data: _Bytes, count: int) -> Any:
        """``count`` numbers, of whatever type they are kept as; imaginary parts are left."""
        self.spend(count)
        if not count:
            return ()
        kind, body = self.element(data)
        if kind not in _NUMBERS:
            raise ValueError(f"numbers of the type {kind} are not known")
        held = np.dtype(self.order + _NUMBERS[kind])
        if len(body) != count * held.itemsize:
            raise ValueError("an array does not hold what its shape says")
        return np.frombuffer(body, held)

    def text(self, data: _Bytes, shape: tuple[int, ...]) -> str:
        """Text; rows one after the other."""
        if not data.left:
            return ""
        kind, body = self.element(data)
        self.spend(len(body))
        if kind in _TEXTS:
            order = {"<": "-le", ">": "-be"}[self.order] if kind != 16 else ""
            letters = list(bytes(body).decode(_TEXTS[kind] + order, "replace"))
        elif _NUMBERS.get(kind) in ("i1", "u1", "u2"):
            codes = np.frombuffer(body, np.dtype(self.order + _NUMBERS[kind].replace("i", "u")))
            letters = [chr(code) for code in codes.tolist()]
        else:
            raise ValueError(f"text of the type {kind} is not known")
        rows = _by_rows(letters, shape) if len(letters) == int(np.prod(shape)) else letters
        return "".join(rows).rstrip("\0")

    def spend(self, count: int) -> None:
        """Raises ValueError where there are more values than are kept."""
        self.room -= count
        if self.room < 0:
            raise ValueError(f"more than {MAX_VALUES} values")


def _by_rows(values: list[Any], shape: tuple[int, ...]) -> list[Any]:
    """MATLAB keeps arrays column by column."""
    if sum(side > 1 for side in shape) < 2:
        return values
    places = np.arange(len(values)).reshape(shape, order="F").ravel()
    return [values[place] for place in places]


def _unpacked(data: bytes, path: Path) -> tuple[str, memoryview]:
    """Byte order, and the elements, compressed ones unpacked: never more than ``MAX_UNPACKED`` bytes."""
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if order is None:
        raise InputError(f"{path}: is not a .mat file of version 5 to 7.3")
    if data[124:126] in (b"\x00\x02", b"\x02\x00"):
        raise InputError(f"{path}: is a .mat file of version 7.3, save it as version 7")
    out, position = bytearray(), _HEADER
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
    return order, memoryview(bytes(out))
