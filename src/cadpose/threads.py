"""How many threads this process may compute with: several workers on one machine share its cores."""

from __future__ import annotations

import os
import sys

_allowed = 0


def cores() -> int:
    """Cores that this process may run on; a container or ``taskset`` may have fewer than the machine."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def threads() -> int:
    """Threads that one computation may take: as told by :func:`limit_threads`, else one a core."""
    return _allowed or cores()


def thread_limit() -> int:
    """What :func:`limit_threads` was told; 0, which libraries take for their own choice, before that."""
    return _allowed


def limit_threads(count: int) -> None:
    """Let this process compute with so many threads, in every library that has threads of its own.

    To be called before networks are loaded: those that are keep the threads they have.

    Raises:
        ValueError: the count is below 1.
    """
    global _allowed
    if count < 1:
        raise ValueError(f"a process needs 1 thread or more, got {count}")
    _allowed = count
    # Read when NumPy's BLAS, faiss or PyTorch are loaded, which may be later.
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMEXPR_NUM_THREADS"):
        os.environ[name] = str(count)
    import cv2

    cv2.setNumThreads(count)
    torch = sys.modules.get("torch")
    if torch is not None:
        torch.set_num_threads(count)
