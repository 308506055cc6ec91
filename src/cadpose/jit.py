"""How kernels are compiled: numba, no GIL, on-disk cache where a folder can be written."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile on first call, without the GIL, with C's arithmetic: nothing is fused or reordered, so that
    an edge seen from either of its faces is the same number.

    numba looks for a cache folder in NUMBA_CACHE_DIR, beside the source file, then in the user's
    cache folder. Where none of them can be written it refuses to decorate; we then do without a cache,
    which costs a few seconds a process. Kernels call no kernel of another file: numba's cache would
    not notice that the other file has changed.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "fastmath": {"nsz"}}
    try:
        compiled: F = numba.njit(cache=True, **options)(function)
    except RuntimeError:
        compiled = numba.njit(**options)(function)
    return compiled


def inlined(function: F) -> F:
    """For a helper of kernels in its own file that returns many numbers: its code is copied into its
    callers, which saves passing the numbers through memory."""
    paste: Any = numba.njit(inline="always")
    pasted: F = paste(function)
    return pasted
