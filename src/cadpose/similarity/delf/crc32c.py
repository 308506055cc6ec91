"""CRC-32C (Castagnoli), the checksum of TensorFlow's checkpoints, plain and as it is stored there."""

from __future__ import annotations

from typing import Any

import numpy as np

from cadpose.jit import kernel

_POLYNOMIAL = 0x82F63B78
_MASK_DELTA = 0xA282EAD8


def crc32c(data: bytes | memoryview) -> int:
    """The checksum of some bytes."""
    return int(_crc(_TABLE, np.frombuffer(data, np.uint8)))


def masked(data: bytes | memoryview) -> int:
    """The checksum turned and shifted, as it is stored beside the bytes that it is of."""
    crc = crc32c(data)
    return (((crc >> 15) | (crc << 17)) + _MASK_DELTA) & 0xFFFFFFFF


def _table() -> Any:
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> np.uint32(1)) ^ np.uint32(_POLYNOMIAL), table >> np.uint32(1))
    return table.astype(np.uint32)


_TABLE = _table()


@kernel
def _crc(table: Any, data: Any) -> Any:
    crc = np.uint32(0xFFFFFFFF)
    for byte in data:
        crc = table[(crc ^ byte) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
    return crc ^ np.uint32(0xFFFFFFFF)
