"""The container: a glTF 2.0 header and one binary buffer in one .glb file."""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass, field
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

_FLOAT, _UINT16, _UINT32 = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
_MAGIC, _JSON, _BIN = 0x46546C67, 0x4E4F534A, 0x004E4942


@dataclass
class GlbBuilder:
    """Collects the arrays of a glTF file; each ``add`` gives the index that glTF refers to things by."""

    header: dict[str, Any]
    _binary: bytearray = field(default_factory=bytearray)

    def add(self, kind: str, entry: dict[str, Any]) -> int:
        """Append to one of the header's arrays, for example ``"nodes"``."""
        entries: list[dict[str, Any]] = self.header.setdefault(kind, [])
        entries.append(entry)
        return len(entries) - 1

    def blob(self, data: bytes, target: int | None = None) -> int:
        """A buffer view of these bytes."""
        self._binary.extend(bytes(-len(self._binary) % 4))
        view: dict[str, Any] = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._binary.extend(data)
        return self.add("bufferViews", view)

    def vectors(self, values: NDArray[np.float32], *, bounds: bool = False) -> int:
        """An accessor of (N, 2..4) float32 vertex attributes; positions need their bounds."""
        accessor: dict[str, Any] = {
            "bufferView": self.blob(np.ascontiguousarray(values, "<f4").tobytes(), _VERTICES),
            "componentType": _FLOAT,
            "count": len(values),
            "type": _TYPES[values.shape[1]],
        }
        if bounds:
            accessor["min"] = values.min(axis=0).tolist()
            accessor["max"] = values.max(axis=0).tolist()
        return self.add("accessors", accessor)

    def indices(self, faces: NDArray[np.uint32]) -> int:
        """An accessor of (F, 3) triangles."""
        # The largest number of a type restarts a primitive, so it names no vertex.
        small = int(faces.max()) < 65535
        data = np.ascontiguousarray(faces, "<u2" if small else "<u4").tobytes()
        return self.add(
            "accessors",
            {
                "bufferView": self.blob(data, _INDICES),
                "componentType": _UINT16 if small else _UINT32,
                "count": faces.size,
                "type": "SCALAR",
            },
        )

    def to_bytes(self) -> bytes:
        """The whole file."""
        self._binary.extend(bytes(-len(self._binary) % 4))
        header = dict(self.header, buffers=[{"byteLength": len(self._binary)}])
        text = json.dumps(header, ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self._binary)
        return b"".join(
            (
                struct.pack("<3I", _MAGIC, 2, size),
                struct.pack("<2I", len(text), _JSON),
                text,
                struct.pack("<2I", len(self._binary), _BIN),
                bytes(self._binary),
            )
        )


def read_header(file: BinaryIO, most: int) -> dict[str, Any]:
    """The JSON header of an opened .glb file, without its geometry.

    Args:
        file: At its beginning.
        most: Longest header in bytes that is read.

    Raises:
        ValueError: it is no such file, or its header is damaged or longer.
    """
    start = file.read(20)
    if len(start) < 20:
        raise ValueError("it is too short")
    magic, version, _, size, kind = struct.unpack("<5I", start)
    if (magic, version, kind) != (_MAGIC, 2, _JSON):
        raise ValueError("it is no binary glTF 2.0 file")
    if size > most:
        raise ValueError(f"its header of {size} bytes is longer than {most}")
    text = file.read(size)
    if len(text) < size:
        raise ValueError("it is cut off")
    try:
        header = json.loads(text)
    except RecursionError:
        raise ValueError("its header is nested too deep") from None
    if not isinstance(header, dict):
        raise ValueError("its header is no JSON object")
    return header
