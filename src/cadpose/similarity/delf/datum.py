"""DELF's ``.datum`` files: one array of float32 as a DatumProto."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from cadpose.similarity.delf.wire import BYTES, FIXED32, VARINT, fields, varint

_MAX_DIMENSIONS = 8


def read_datum(data: bytes) -> NDArray[np.float32]:
    """The array, in the shape it was stored with.

    Raises:
        ValueError: the file is damaged, holds other numbers than float32, or values that are not finite.
    """
    shape: list[int] = []
    values: list[NDArray[np.float32]] = []
    for number, kind, _, part in fields(memoryview(data)):
        if (number, kind) == (1, BYTES):
            shape += _shape(part)
        elif (number, kind) == (2, BYTES):
            values += _floats(part)
        else:
            raise ValueError(f"field {number} is not of a float32 datum")
    array = np.concatenate(values) if values else np.empty(0, np.float32)
    if len(shape) > _MAX_DIMENSIONS or math.prod(shape) != len(array):
        raise ValueError(f"{len(array)} numbers for the shape {tuple(shape)}")
    if not np.isfinite(array).all():
        raise ValueError("it holds values that are not numbers")
    return array.reshape(shape)


def _shape(message: memoryview) -> list[int]:
    sizes: list[int] = []
    for number, kind, value, part in fields(message):
        if (number, kind) == (1, VARINT):
            sizes.append(value)
        elif (number, kind) == (1, BYTES):  # packed
            at = 0
            while at < len(part):
                size, at = varint(part, at)
                sizes.append(size)
    return sizes


def _floats(message: memoryview) -> list[NDArray[np.float32]]:
    values = []
    for number, kind, value, part in fields(message):
        if (number, kind) == (1, BYTES):  # packed
            if len(part) % 4:
                raise ValueError("a list of numbers is cut off")
            values.append(np.frombuffer(part, "<f4").astype(np.float32))
        elif (number, kind) == (1, FIXED32):
            values.append(np.frombuffer(value.to_bytes(4, "little"), "<f4").astype(np.float32))
    return values
