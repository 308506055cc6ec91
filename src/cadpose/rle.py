"""COCO's run-length masks: column by column, the first run is background; runs as numbers or as text.

The text form writes each run, less the run two before it, in groups of five bits from the lowest on,
each in one character from ``0`` (48) on, bit 6 telling that more follow (COCO's own mask format).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cadpose.records import Mask

#: Largest mask that is decoded, twice the pixels that a photo may have.
MAX_PIXELS = 100_000_000


def encode_mask(mask: Mask) -> list[int]:
    """Runs of a (H, W) bool mask in column-major order, background first (that run may be 0)."""
    flat = np.asarray(mask, np.bool_).ravel(order="F")
    if not len(flat):
        return []
    changes = np.flatnonzero(flat[1:] != flat[:-1]) + 1
    runs = np.diff(np.concatenate([[0], changes, [len(flat)]])).tolist()
    return [0, *runs] if flat[0] else [int(run) for run in runs]


def decode_mask(size: Sequence[int], counts: Sequence[int]) -> Mask:
    """(H, W) bool mask of COCO's ``{"size": [H, W], "counts": counts}``.

    Raises:
        ValueError: a side is below 1, the mask is larger than ``MAX_PIXELS``, or the runs are negative
            or do not add up to its area. Nothing is allocated before these checks.
    """
    check_runs(size, counts)
    height, width = size
    runs = np.asarray(counts, np.int64)
    flat = np.repeat(np.arange(len(runs)) % 2 == 1, runs)
    return np.ascontiguousarray(flat.reshape((height, width), order="F"))


def check_runs(size: Sequence[int], counts: Sequence[int]) -> None:
    """Raise ValueError unless ``decode_mask`` would succeed."""
    if len(size) != 2 or min(size) < 1:
        raise ValueError(f"a mask's size is [height, width], both at least 1, not {list(size)[:3]}")
    height, width = size
    if height * width > MAX_PIXELS:
        raise ValueError(f"a mask of {height} x {width} pixels is above the limit of {MAX_PIXELS}")
    if min(counts, default=0) < 0:
        raise ValueError("a mask's runs must not be negative")
    if sum(counts) != height * width:
        raise ValueError(f"a mask's runs add up to {sum(counts)}, not to {height} x {width}")


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


def text_from_runs(runs: Sequence[int]) -> str:
    """COCO's compressed form of runs, as `runs_from_text` reads it.

    Raises:
        ValueError: a run is negative or above 2**38, which the text form cannot hold.
    """
    if min(runs, default=0) < 0 or max(runs, default=0) > 1 << 38:
        raise ValueError("a mask's runs must be between 0 and 2**38")
    value = np.asarray(runs, np.int64).copy()
    value[3:] -= np.asarray(runs, np.int64)[1:-2]
    codes, used = np.zeros((8, len(value)), np.uint8), np.zeros((8, len(value)), np.bool_)
    going = np.ones(len(value), np.bool_)
    for place in range(8):
        group, value = value & 31, value >> 5
        # Done when what is left is the sign that bit 4 of the group tells.
        done = value == -(group >> 4)
        codes[place] = 48 + group + np.where(done, 0, 32)
        used[place] = going
        going = going & ~done
        if not going.any():
            break
    return codes.T[used.T].tobytes().decode("ascii")
