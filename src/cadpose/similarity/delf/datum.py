"""DELF's ``.datum`` files: one array of float32 as a DatumProto."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from cadpose.similarity.delf.wire import BYTES, FIXED32, VARINT, fields, varint

#: Largest file that is read; DELF's have at most 4 MB.
MAX_BYTES = 16 * 2**20
MAX_DIMENSIONS = 8


def read_datum(data: bytes) -> NDArray[np.float32]:
    """The array, in the shape it was stored with.

    Raises:
        ValueError: the file is damaged or too large, holds other numbers than float32, or values that are not
            finite.
    """
    if len(data) > MAX_BYTES:
        raise ValueError(f"it has more than {MAX_BYTES >> 20} MiB")
    shape: list[int] = []
    values = bytearray()
    for number, kind, _, part in fields(memoryview(data)):
        if (number, kind) == (1, BYTES):
            for size in _sizes(part):
                shape.append(size)
                if len(shape) > MAX_DIMENSIONS:
                    raise ValueError(f"it has more than {MAX_DIMENSIONS} dimensions")
        elif (number, kind) == (2, BYTES):
            _add_floats(part, values)
        else:
            raise ValueError(f"field {number} is not of a float32 datum")
    array = np.frombuffer(values, "<f4").astype(np.float32)
    if math.prod(shape) != len(array):
        raise ValueError(f"{len(array)} numbers for the shape {tuple(shape)}")
    if not np.isfinite(array).all():
        raise ValueError("it holds values that are not numbers")
    return array.reshape(shape)


def _sizes(message: memoryview) -> Iterator[int]:
    for number, kind, value, part in fields(message):
        if (number, kind) == (1, VARINT):
            yield value
        elif (number, kind) == (1, BYTES):  # packed
            at = 0
            while at < len(part):
                size, at = varint(part, at)
                yield size


def _add_floats(message: memoryview, values: bytearray) -> None:
    """Adds the numbers' bytes: one array for each number would take a second for every 50,000."""
    for number, kind, value, part in fields(message):
        if (number, kind) == (1, BYTES):  # packed
            if len(part) % 4:
                raise ValueError("a list of numbers is cut off")
            values += part
        elif (number, kind) == (1, FIXED32):
            values += value.to_bytes(4, "little")
