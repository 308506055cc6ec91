"""Made-up variables of DELF's real names and shapes, and files as TensorFlow writes them."""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cadpose.similarity.delf.crc32c import masked
from cadpose.similarity.delf.parameters import CHANNELS, variable_shapes

FloatArray = NDArray[np.float32]


def made_variables() -> tuple[dict[str, FloatArray], FloatArray, FloatArray]:
    """What scripts/delf_reference.py gives TensorFlow's variables, drawn in the same order: and the PCA."""
    rng = np.random.default_rng(0)
    made: dict[str, FloatArray] = {}
    for name, shape in sorted(variable_shapes().items()):
        drawn = rng.random(shape)
        if name.endswith("/weights"):
            drawn = (drawn - 0.5) * np.sqrt(24.0 / np.prod(shape[:3]))
        elif name.endswith(("/gamma", "/moving_variance")):
            drawn = 0.5 + drawn
        else:
            drawn = (drawn - 0.5) * 0.2
        made[name] = drawn.astype(np.float32)
    mean, matrix = rng.random(CHANNELS) * 0.05, rng.random((CHANNELS, CHANNELS)) - 0.5
    return made, mean.astype(np.float32), matrix.astype(np.float32)


def image(height: int, width: int) -> NDArray[np.uint8]:
    """The picture of scripts/delf_reference.py."""
    y, x = np.mgrid[:height, :width]
    channels = [127.5 + 127.5 * np.sin(x / 17.0 + c) * np.cos(y / (11.0 + c)) for c in range(3)]
    picture = np.stack(channels, axis=2)
    picture[height // 3 : height // 2, width // 4 :] = (250.0, 40.0, 90.0)
    return np.asarray(np.rint(picture), np.uint8)


def varint(n: int) -> bytes:
    return bytes([n]) if n < 128 else bytes([n & 127 | 128]) + varint(n >> 7)


def number(field: int, n: int) -> bytes:
    return varint(field << 3) + varint(n)


def part(field: int, data: bytes) -> bytes:
    return varint(field << 3 | 2) + varint(len(data)) + data


def datum(array: FloatArray) -> bytes:
    """A DatumProto."""
    shape = part(1, b"".join(varint(n) for n in array.shape))
    return part(1, shape) + part(2, part(1, array.astype("<f4").tobytes()))


def entry(shape: tuple[int, ...], offset: int, data: bytes, *, dtype: int = 1, shard: int = 0) -> bytes:
    """A BundleEntryProto."""
    shaped = b"".join(part(2, number(1, n) if n else b"") for n in shape)
    told = number(1, dtype) + part(2, shaped)
    told += (number(3, shard) if shard else b"") + (number(4, offset) if offset else b"")
    return told + number(5, len(data)) + bytes([6 << 3 | 5]) + struct.pack("<I", masked(data))


def header(shards: int = 1, *, endianness: int = 0, oldest: int = 0) -> bytes:
    """A BundleHeaderProto."""
    version = number(1, 1) + (number(2, oldest) if oldest else b"")
    return number(1, shards) + (number(2, endianness) if endianness else b"") + part(3, version)


def table(entries: Mapping[str, bytes], *, a_block: int = 100, compression: int = 0) -> bytes:
    """A sorted-string table, so many entries a block, keys written in full every 16."""
    out = bytearray()

    def add(rows: list[tuple[bytes, bytes]]) -> bytes:
        block, restarts, before = bytearray(), [], b""
        for i, (key, value) in enumerate(rows):
            shared = 0
            if i % 16 == 0:
                restarts.append(len(block))
            else:
                while shared < min(len(key), len(before)) and key[shared] == before[shared]:
                    shared += 1
            block += varint(shared) + varint(len(key) - shared) + varint(len(value)) + key[shared:] + value
            before = key
        block += struct.pack(f"<{len(restarts) + 1}I", *restarts, len(restarts))
        handle = varint(len(out)) + varint(len(block))
        out.extend(block)
        out.append(compression)
        out.extend(struct.pack("<I", masked(bytes(block) + bytes([compression]))))
        return handle

    rows = [(key.encode(), value) for key, value in sorted(entries.items())]
    blocks = [rows[i : i + a_block] for i in range(0, len(rows), a_block)]
    handles = [(block[-1][0], add(block)) for block in blocks]
    meta, index = add([]), add(handles)
    footer = meta + index
    return bytes(out) + footer + bytes(40 - len(footer)) + struct.pack("<Q", 0xDB4775248B80FB57)


def bundle(variables: Mapping[str, FloatArray], shards: int = 1) -> tuple[bytes, list[bytes]]:
    """Index and data files, the variables dealt out to the files in turn."""
    files = [bytearray() for _ in range(shards)]
    entries = {"": header(shards)}
    for i, (name, values) in enumerate(sorted(variables.items())):
        data, file = values.astype("<f4").tobytes(), files[i % shards]
        entries[name] = entry(values.shape, len(file), data, shard=i % shards)
        file += data
    return table(entries), [bytes(file) for file in files]


def write_model(
    folder: Path, variables: Mapping[str, FloatArray], mean: FloatArray, matrix: FloatArray
) -> None:
    """The files of DELF's archive that are read, and one that is not."""
    index, files = bundle(variables, shards=2)
    (folder / "model" / "variables").mkdir(parents=True)
    (folder / "pca").mkdir()
    (folder / "model" / "saved_model.pb").write_bytes(b"a graph")
    (folder / "model" / "variables" / "variables.index").write_bytes(index)
    for i, data in enumerate(files):
        (folder / "model" / "variables" / f"variables.data-{i:05}-of-{len(files):05}").write_bytes(data)
    (folder / "pca" / "mean.datum").write_bytes(datum(mean))
    (folder / "pca" / "pca_proj_mat.datum").write_bytes(datum(matrix))
