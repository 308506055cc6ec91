"""Protocol buffers' wire format, as far as checkpoints need it: numbers and byte strings by field number."""

from __future__ import annotations

from collections.abc import Iterator

VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
_MOST_VARINT_BYTES = 10


def varint(data: memoryview, at: int) -> tuple[int, int]:
    """An unsigned number of seven bits a byte, and where the next thing begins.

    Raises:
        ValueError: the data end within it, or it does not fit 64 bits.
    """
    value = 0
    for shift, byte in enumerate(data[at : at + _MOST_VARINT_BYTES]):
        value |= (byte & 0x7F) << (7 * shift)
        if byte < 0x80:
            if value >> 64:
                break
            return value, at + shift + 1
    raise ValueError("a number is cut off or too long")


def fields(message: memoryview) -> Iterator[tuple[int, int, int, memoryview]]:
    """A message's fields in order.

    Yields:
        Field number, wire type, value (0 for byte strings), bytes (empty for numbers).

    Raises:
        ValueError: the message is cut off or has a wire type that is not in use.
    """
    at, nothing = 0, message[:0]
    while at < len(message):
        key, at = varint(message, at)
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            value, at = varint(message, at)
            yield number, kind, value, nothing
            continue
        if kind == BYTES:
            length, at = varint(message, at)
        elif kind in (FIXED32, FIXED64):
            length = 4 if kind == FIXED32 else 8
        else:
            raise ValueError(f"field {number} is of wire type {kind}")
        if length > len(message) - at:
            raise ValueError(f"field {number} is cut off")
        part = message[at : at + length]
        at += length
        if kind == BYTES:
            yield number, kind, 0, part
        else:
            yield number, kind, int.from_bytes(part, "little"), nothing
