"""TensorFlow's V2 checkpoint, which is also the ``variables`` of a SavedModel, read without TensorFlow.

The index is a sorted-string table as LevelDB has them: blocks of entries whose keys share prefixes, a block
of handles of these blocks, and a footer. The entry of the empty key is a BundleHeaderProto, the others are
BundleEntryProtos by variable name: kind, shape, and where in which data file the numbers lie. Every block
and every variable has a CRC-32C, and all are checked. Verified against TensorFlow's own sources
(core/lib/io/format.cc, core/util/tensor_bundle) and a bundle written by TensorFlow 2.15.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cadpose.similarity.delf.crc32c import masked
from cadpose.similarity.delf.wire import BYTES, VARINT, fields, varint

#: Largest index that is read; that of a ResNet-50 has some 20 kB.
MAX_INDEX_BYTES = 16 * 2**20
MAX_ENTRIES = 100_000
MAX_KEY_BYTES = 4096
MAX_DIMENSIONS = 8

_FOOTER = 48
_MAGIC = 0xDB4775248B80FB57
#: After each block: one byte that tells the compression, four of checksum.
_TRAILER = 5
_FLOAT = 1  # DataType.DT_FLOAT
_READABLE_VERSION = 1


@dataclass(frozen=True, slots=True)
class Entry:
    """One variable of the index.

    Attributes:
        dtype: TensorFlow's DataType; 1 is float32.
        shape: Its shape.
        shard: Which data file.
        offset: First byte in it.
        size: Bytes.
        crc: Masked CRC-32C of these bytes.
        sliced: It is kept in slices under other keys.
    """

    dtype: int
    shape: tuple[int, ...]
    shard: int
    offset: int
    size: int
    crc: int
    sliced: bool


@dataclass(frozen=True, slots=True)
class Index:
    """A bundle's table of contents.

    Attributes:
        shards: Number of data files.
        entries: Variables by name.
    """

    shards: int
    entries: dict[str, Entry]


def read_index(data: bytes) -> Index:
    """What ``*.index`` says.

    Raises:
        ValueError: it is damaged, too large, or of a kind that is not read.
    """
    if not _FOOTER <= len(data) <= MAX_INDEX_BYTES:
        raise ValueError(f"an index of {len(data)} bytes")
    view = memoryview(data)
    footer = view[-_FOOTER:]
    if int.from_bytes(footer[-8:], "little") != _MAGIC:
        raise ValueError("not a checkpoint's index (no magic number at its end)")
    _, at = _handle(footer, 0)  # of the meta-index, which is empty
    handle, _ = _handle(footer, at)
    shards, entries, end = 0, dict[str, Entry](), 0
    for _, value in _block(view, handle):
        offset, size = _handle(value, 0)[0]
        if offset < end:  # else a small file could name one block a million times
            raise ValueError("blocks of the index overlap")
        end = offset + size + _TRAILER
        for key, message in _block(view, (offset, size)):
            if len(entries) >= MAX_ENTRIES:
                raise ValueError(f"more than {MAX_ENTRIES} variables")
            if key:
                entries[key.decode("utf-8")] = _entry(message)
            else:
                shards = _shards(message)
    if not shards:
        raise ValueError("the index has no header")
    return Index(shards, entries)


def read_variables(
    index: Index, files: Sequence[bytes], names: Iterable[str]
) -> dict[str, NDArray[np.float32]]:
    """float32 variables by name.

    Args:
        index: What :func:`read_index` gave.
        files: Contents of the data files in order.
        names: Which variables.

    Raises:
        ValueError: one is absent, of another kind than float32, damaged, or not finite.
    """
    if len(files) != index.shards:
        raise ValueError(f"{len(files)} data files where the index tells of {index.shards}")
    return {name: _variable(index, files, name) for name in names}


def _variable(index: Index, files: Sequence[bytes], name: str) -> NDArray[np.float32]:
    entry = index.entries.get(name)
    if entry is None:
        raise ValueError(f"there is no variable {name}")
    if entry.dtype != _FLOAT or entry.sliced:
        raise ValueError(f"{name} is in slices or not of 32-bit numbers")
    if entry.shard >= len(files) or entry.size != 4 * math.prod(entry.shape):
        raise ValueError(f"{name} has an entry that contradicts itself")
    part = memoryview(files[entry.shard])[entry.offset : entry.offset + entry.size]
    if len(part) != entry.size:
        raise ValueError(f"the data end within {name}")
    if masked(part) != entry.crc:
        raise ValueError(f"{name} is damaged (its checksum differs)")
    values = np.frombuffer(part, "<f4").astype(np.float32).reshape(entry.shape)
    if not np.isfinite(values).all():
        raise ValueError(f"{name} holds values that are not numbers")
    return values


def _handle(data: memoryview, at: int) -> tuple[tuple[int, int], int]:
    """A block's offset and size, and where the next thing begins."""
    offset, at = varint(data, at)
    size, at = varint(data, at)
    return (offset, size), at


def _block(data: memoryview, handle: tuple[int, int]) -> Iterator[tuple[bytes, memoryview]]:
    """Keys and values of a block, each key stored as what it adds to the key before it."""
    offset, size = handle
    if offset + size + _TRAILER > len(data) - _FOOTER:
        raise ValueError("a block lies outside the index")
    block, trailer = data[offset : offset + size], data[offset + size : offset + size + _TRAILER]
    if masked(data[offset : offset + size + 1]) != int.from_bytes(trailer[1:], "little"):
        raise ValueError("a block of the index is damaged (its checksum differs)")
    if trailer[0]:
        raise ValueError("the index is compressed, which no checkpoint since TensorFlow 1.2 is")
    # The last word counts the places, kept in the words before it, where a key is written in full.
    end = size - 4 - 4 * int.from_bytes(block[-4:], "little")
    if size < 4 or end < 0:
        raise ValueError("a block of the index is cut off")
    at, key = 0, b""
    while at < end:
        shared, at = varint(block, at)
        added, at = varint(block, at)
        length, at = varint(block, at)
        if shared > len(key) or shared + added > MAX_KEY_BYTES or added + length > end - at:
            raise ValueError("an entry of the index is malformed")
        key = key[:shared] + bytes(block[at : at + added])
        at += added
        yield key, block[at : at + length]
        at += length


def _shards(message: memoryview) -> int:
    """Data files of a BundleHeaderProto; numbers that are 0 are not written."""
    shards = 0
    for number, kind, value, part in fields(message):
        if number == 1 and kind == VARINT:
            shards = value
        elif number == 2 and value:
            raise ValueError("it was written on a big-endian machine")
        elif number == 3 and kind == BYTES:
            oldest = [v for n, k, v, _ in fields(part) if (n, k) == (2, VARINT)]
            if oldest and oldest[-1] > _READABLE_VERSION:
                raise ValueError("it is of a newer format")
    return shards


def _entry(message: memoryview) -> Entry:
    """A BundleEntryProto."""
    numbers = dict.fromkeys((1, 3, 4, 5, 6), 0)
    shape: tuple[int, ...] = ()
    sliced = False
    for number, kind, value, part in fields(message):
        if number == 2 and kind == BYTES:
            shape = _shape(part)
        elif number == 7:
            sliced = True
        elif number in numbers and kind != BYTES:
            numbers[number] = value
    return Entry(
        dtype=numbers[1],
        shape=shape,
        shard=numbers[3],
        offset=numbers[4],
        size=numbers[5],
        crc=numbers[6],
        sliced=sliced,
    )


def _shape(message: memoryview) -> tuple[int, ...]:
    """A TensorShapeProto: each dimension a message of its own, of which a 0 is not written."""
    shape = []
    for number, kind, _, part in fields(message):
        if number == 2 and kind == BYTES:
            sizes = [v for n, k, v, _ in fields(part) if (n, k) == (1, VARINT)]
            shape.append(sizes[-1] if sizes else 0)
    if len(shape) > MAX_DIMENSIONS:
        raise ValueError(f"a variable of {len(shape)} dimensions")
    return tuple(shape)
