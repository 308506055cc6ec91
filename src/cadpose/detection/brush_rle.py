"""Label Studio's run-length masks: thi.ng/umbrella's rle-pack over the RGBA values of a picture.

A stream of bits, the highest of each byte first. Head: 32 bits the number of values, 5 bits a value's width
less 1, four times 4 bits the widths less 1 of the four kinds of counts. Then blocks until all values are
there: 1 bit whether the block repeats one value, 2 bits the kind of its count, the count less 1, and then
that one value or all of them. Label Studio packs bytes, four a pixel, row by row; alpha is the mask.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cadpose.records import Mask
from cadpose.rle import MAX_PIXELS

#: Longest stream that is read, in bytes.
MAX_BYTES = 16 * 2**20
_HEAD_BITS = 32 + 5 + 4 * 4
_BITS = 8  # of a value
_SIZES = (3, 4, 8, 16)  # of the four kinds of counts, when written


def decode_brush(stream: bytes, width: int, height: int) -> Mask:
    """The mask of a brush stroke.

    Args:
        stream: The bytes that ``value.rle`` lists.
        width: Of the photo.
        height: Of the photo.

    Returns:
        (height, width) bool, True where alpha is 128 or more.

    Raises:
        ValueError: the stream is too long, is cut short, or does not hold a picture of that size. Nothing
            is allocated before the size is checked.
    """
    if len(stream) > MAX_BYTES:
        raise ValueError(f"its brush mask has more than {MAX_BYTES // 2**20} MB")
    if width * height > MAX_PIXELS:
        raise ValueError(f"a mask of {height} x {width} pixels is above the limit of {MAX_PIXELS}")
    if len(stream) * 8 < _HEAD_BITS:
        raise ValueError("its brush mask is cut short")
    bits = _Bits(stream)
    count = bits.read(32)
    if count != 4 * width * height:
        raise ValueError(f"its brush mask has {count} values, not 4 for each of {width} x {height} pixels")
    if bits.read(5) + 1 != _BITS:
        raise ValueError("its brush mask holds values that are no bytes")
    sizes = [bits.read(4) + 1 for _ in range(4)]
    values = np.empty(count, np.uint8)
    done = 0
    while done < count:
        repeats = bits.read(1)
        end = done + bits.read(sizes[bits.read(2)]) + 1
        if end > count:
            raise ValueError("its brush mask runs past its end")
        values[done:end] = bits.read(_BITS) if repeats else bits.values(end - done)
        done = end
    return np.ascontiguousarray(values.reshape(height, width, 4)[..., 3] >= 128)


def encode_brush(mask: Mask) -> bytes:
    """The stream of a mask as Label Studio packs it: 255 in all four channels on the object.

    Args:
        mask: (height, width) bool.

    Returns:
        What ``value.rle`` lists; `decode_brush` gives the mask back.
    """
    flat = np.asarray(mask, np.bool_).ravel()
    starts = np.concatenate([[0], np.flatnonzero(flat[1:] != flat[:-1]) + 1])
    runs = np.diff(np.concatenate([starts, [len(flat)]])) * 4
    pieces = [f"{4 * len(flat):032b}{_BITS - 1:05b}", *(f"{size - 1:04b}" for size in _SIZES)]
    for first, run in zip(starts.tolist(), runs.tolist(), strict=True):
        value = "11111111" if flat[first] else "00000000"
        while run > 0:
            count = min(run, 1 << _SIZES[-1])
            kind = next(i for i, size in enumerate(_SIZES) if count <= 1 << size)
            pieces.append(f"1{kind:02b}{count - 1:0{_SIZES[kind]}b}{value}")
            run -= count
    bits = "".join(pieces)
    bits += "0" * (-len(bits) % 8)
    return int(bits, 2).to_bytes(len(bits) // 8, "big")


class _Bits:
    """Reads a stream bit by bit."""

    def __init__(self, stream: bytes) -> None:
        self._bytes = np.frombuffer(stream, np.uint8)
        self._stream = stream
        self._at = 0

    def read(self, size: int) -> int:
        """The next ``size`` bits, at most 32, as a number."""
        first, end = self._at >> 3, self._at + size
        if end > 8 * len(self._stream):
            raise ValueError("its brush mask is cut short")
        last = (end + 7) >> 3
        self._at = end
        window = int.from_bytes(self._stream[first:last], "big")
        return (window >> (8 * last - end)) & ((1 << size) - 1)

    def values(self, count: int) -> NDArray[np.uint8]:
        """(count,) the next bytes, which may begin within a byte of the stream."""
        first, shift = self._at >> 3, self._at & 7
        self._at += 8 * count
        if self._at > 8 * len(self._stream):
            raise ValueError("its brush mask is cut short")
        if not shift:
            return self._bytes[first : first + count]
        high = self._bytes[first : first + count] << np.uint8(shift)
        return high | (self._bytes[first + 1 : first + count + 1] >> np.uint8(8 - shift))
