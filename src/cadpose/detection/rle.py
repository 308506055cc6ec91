"""COCO's run-length masks: column by column, the first run is background; runs as numbers or as text.

The text form writes each run, less the run two before it, in groups of five bits from the lowest on,
each in one character from ``0`` (48) on, bit 6 telling that more follow (COCO's own mask format).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.records import Mask


def mask_from_runs(height: int, width: int, runs: Sequence[int]) -> Mask:
    """(height, width) bool mask.

    Raises:
        ValueError: the runs are negative or do not add up to the area; nothing is allocated before.
    """
    if any(run < 0 for run in runs) or sum(runs) != height * width:
        raise ValueError(f"the runs do not add up to a mask of {height} x {width}")
    flat = np.repeat(np.arange(len(runs)) % 2 == 1, np.asarray(runs, np.int64))
    return np.ascontiguousarray(flat.reshape((width, height)).T)


def runs_from_text(text: str) -> list[int]:
    """The runs of COCO's compressed form.

    Raises:
        ValueError: the text holds other characters, ends within a number, or has a number out of range.
    """
    runs: list[int] = []
    value = shift = 0
    for character in text:
        code = ord(character) - 48
        if not 0 <= code < 64:
            raise ValueError("a compressed mask holds a character that none may hold")
        value |= (code & 31) << shift
        shift += 5
        if shift > 40:
            raise ValueError("a compressed mask holds a number that is out of range")
        if not code & 32:
            if code & 16:
                value -= 1 << shift
            runs.append(value + (runs[-2] if len(runs) > 2 else 0))
            value = shift = 0
    if shift:
        raise ValueError("a compressed mask ends within a number")
    return runs
