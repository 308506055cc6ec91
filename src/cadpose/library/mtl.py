"""Wavefront material files: the few statements that matter for colour, texture and see-through."""

from __future__ import annotations

import re
from dataclasses import dataclass

# Options of a map statement with the number of values each takes (Wavefront MTL specification).
_MAP_OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-bm": 1, "-boost": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1,
    "-mm": 2, "-texres": 1, "-type": 1, "-o": 3, "-s": 3, "-t": 3,
}  # fmt: skip
_NUMBER = re.compile(r"^[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?$")


@dataclass(slots=True)
class MtlMaterial:
    """One ``newmtl`` block.

    Attributes:
        name: As written after ``newmtl``.
        kd: Diffuse colour, taken as a display (sRGB) value in [0, 1], as most viewers do.
        alpha: 1 is opaque; ``d``, or 1 - ``Tr`` where there is no ``d``.
        map_kd: Diffuse texture's name as written, or None.
        map_d: Opacity texture's name as written, or None.
    """

    name: str
    kd: tuple[float, float, float] = (0.7, 0.7, 0.7)
    alpha: float = 1.0
    map_kd: str | None = None
    map_d: str | None = None


def parse_mtl(text: str) -> dict[str, MtlMaterial]:
    """Materials by name; statements that do not parse are passed over."""
    materials: dict[str, MtlMaterial] = {}
    current: MtlMaterial | None = None
    has_d = False
    for line in text.splitlines():
        parts = line.split()
        if len(parts) < 2:
            continue
        key = parts[0].lower()
        if key == "newmtl":
            current = MtlMaterial(" ".join(parts[1:]))
            materials[current.name] = current
            has_d = False
        elif current is None:
            continue
        elif key == "kd":
            values = _numbers(parts[1:4])
            if values:
                r, g, b = (values * 3)[:3] if len(values) < 3 else values
                current.kd = (_unit(r), _unit(g), _unit(b))
        elif key == "d":
            values = _numbers(parts[-1:])
            if values:
                current.alpha, has_d = _unit(values[0]), True
        elif key == "tr" and not has_d:
            values = _numbers(parts[1:2])
            if values:
                current.alpha = 1.0 - _unit(values[0])
        elif key == "map_kd":
            current.map_kd = _map_name(line)
        elif key == "map_d":
            current.map_d = _map_name(line)
    return materials


def _numbers(parts: list[str]) -> list[float]:
    return [float(p) for p in parts if _NUMBER.match(p)]


def _unit(value: float) -> float:
    return min(1.0, max(0.0, value))


def _map_name(line: str) -> str | None:
    """The file name of a map statement: what is left after its options, spaces included."""
    rest = line.strip().split(None, 1)[1].split("#", 1)[0].strip()
    while rest.startswith("-"):
        parts = rest.split()
        if parts[0].lower() not in _MAP_OPTIONS:
            break
        take = 1
        # -o, -s and -t may leave out their last values.
        for value in parts[1 : 1 + _MAP_OPTIONS[parts[0].lower()]]:
            if _MAP_OPTIONS[parts[0].lower()] > 1 and not _NUMBER.match(value):
                break
            take += 1
        tail = rest.split(None, take)
        rest = tail[take] if len(tail) > take else ""
    return rest or None
