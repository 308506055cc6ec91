"""Two runs of ``cadpose bench``: what became slower, the machine's own speed taken out."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cadpose.errors import InputError

#: No timing, and no machine, reaches this: what fits no float is no number here.
_MOST = 1e15
#: A run's JSON is no larger.
MAX_BYTES = 1 << 20
#: Where both timings are below so many milliseconds nothing is said: they are lost in the noise.
_LEAST_MS = 2.0
#: Timings of one core's time.
_ONE_CORE = ("galleries", "synth")


@dataclass(frozen=True)
class Change:
    """One timing of two runs.

    Attributes:
        name: For example ``stages: detect``.
        before: Milliseconds.
        after: Milliseconds.
        ratio: ``after`` over ``before``, both in units of what the machine's product of matrices took in its
            run: above 1 is slower.
    """

    name: str
    before: float
    after: float
    ratio: float


def read_baseline(path: Path) -> dict[str, Any]:
    """What ``cadpose bench --json`` wrote.

    Raises:
        InputError: the file cannot be read or is no such run.
    """
    # Looked at before it is opened: a pipe would wait for a writer.
    if not path.is_file():
        raise InputError(f"there is no file {path}: name the output of `cadpose bench --json`")
    try:
        with path.open("rb") as file:
            data = file.read(MAX_BYTES + 1)
        if len(data) > MAX_BYTES:
            raise InputError(f"{path} is too large for a run of `cadpose bench --json`")
        told = json.loads(data)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}") from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path} is no JSON of `cadpose bench --json`: {error}") from error
    machine = told.get("machine") if isinstance(told, dict) else None
    if not all(_positive(machine, key) for key in ("gflops", "gflops_one_core")) or not timings(told):
        raise InputError(f"{path} is no run of `cadpose bench --json` of this version: make a new one")
    return dict(told)


def compare(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[Change]:
    """What both runs measured, the slowest first."""
    old, new = timings(before), timings(after)
    changes = []
    for name in new:
        if name in old and max(old[name], new[name]) >= _LEAST_MS:
            key = "gflops_one_core" if name.startswith(_ONE_CORE) else "gflops"
            scale = float(after["machine"][key]) / float(before["machine"][key])
            changes.append(Change(name, old[name], new[name], scale * new[name] / old[name]))
    return sorted(changes, key=lambda change: -change.ratio)


def unmatched(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """What only one of the runs measured, so that nothing can be said of it."""
    return sorted(timings(before).keys() ^ timings(after).keys())


def slower(changes: Sequence[Change], tolerance: float) -> list[Change]:
    """Those that are slower by more than a share."""
    return [change for change in changes if change.ratio > 1.0 + tolerance]


def timings(told: Mapping[str, Any]) -> dict[str, float]:
    """Milliseconds by name; what is told a minute or a second is turned around."""
    found: dict[str, float] = {}
    for part in ("stages", "rotation", "ranking"):
        for name, ms in _table(told.get(part)).items():
            found[f"{part}: {name}"] = ms
    for part, key in (("candidates", "ms"), ("renderers", "ms_per_view")):
        rows = told.get(part)
        for row in rows if isinstance(rows, list) else []:
            if isinstance(row, dict) and _positive(row, key):
                found[f"{part}: {row.get('name')}"] = float(row[key])
    if _positive(told.get("galleries"), "per_minute"):
        found["galleries: a model"] = 60_000.0 / told["galleries"]["per_minute"]
    for key in ("drawing", "writing"):
        if _positive(told.get("synth"), key):
            found[f"synth: {key} a photo"] = 1000.0 / told["synth"][key]
    return found


def _table(told: object) -> dict[str, float]:
    rows = told if isinstance(told, dict) else {}
    return {str(name): float(rows[name]) for name in rows if _positive(rows, name)}


def _positive(told: object, key: str) -> bool:
    value = told.get(key) if isinstance(told, dict) else None
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < _MOST
