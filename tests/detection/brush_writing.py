"""Label Studio's run lengths written from their description, for tests."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

SIZES = (3, 4, 8, 16)


def brush_stream(rgba: NDArray[np.uint8], *, literal: bool = False, sizes: tuple[int, ...] = SIZES) -> bytes:
    """An (H, W, 4) picture as rle-pack writes it: runs, or with ``literal`` blocks of single values."""
    values = rgba.ravel().tolist()
    bits = [f"{len(values):032b}", "00111", *(f"{size - 1:04b}" for size in sizes)]
    at = 0
    while at < len(values):
        run = 1
        while not literal and at + run < len(values) and values[at + run] == values[at]:
            run += 1
        if literal:
            run = len(values) - at
        run = min(run, 2 ** sizes[-1])
        kind = next(k for k, size in enumerate(sizes) if run <= 2**size)
        bits += ["0" if literal else "1", f"{kind:02b}", f"{run - 1:0{sizes[kind]}b}"]
        bits += [f"{value:08b}" for value in (values[at : at + run] if literal else values[at : at + 1])]
        at += run
    text = "".join(bits)
    text += "0" * (-len(text) % 8)
    return bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8))
