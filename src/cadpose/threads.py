"""How many threads this process may compute with: several workers on one machine share its cores."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import lru_cache
from threading import local
from typing import TypeVar

Item = TypeVar("Item")
Answer = TypeVar("Answer")

_allowed = 0
_within = local()


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


def spread(work: Callable[[Item], Answer], items: Iterable[Item]) -> list[Answer]:
    """``[work(item) for item in items]``, on as many threads as this process may have.

    For work that gives up Python's lock: networks, rendering, products of matrices. Work within such work
    stays on its thread. What libraries do with threads of their own, BLAS above all, is not counted.
    """
    many = list(items)
    count = threads()
    if count == 1 or len(many) < 2 or getattr(_within, "now", False):
        return [work(item) for item in many]

    def alone(item: Item) -> Answer:
        _within.now = True
        return work(item)

    try:
        answers = _pool(count, os.getpid()).map(alone, many)
    except RuntimeError:  # the interpreter is going down and starts no thread any more
        return [work(item) for item in many]
    return list(answers)


@contextmanager
def on_one_thread() -> Iterator[None]:
    """Within, :func:`spread` stays on the calling thread."""
    before = getattr(_within, "now", False)
    _within.now = True
    try:
        yield
    finally:
        _within.now = before


def shares(count: int) -> list[slice]:
    """``count`` rows cut into as many parts as threads, for :func:`spread`."""
    each = max(-(-count // threads()), 1)
    return [slice(begin, min(begin + each, count)) for begin in range(0, count, each)]


@lru_cache(maxsize=2)
def _pool(count: int, process: int) -> ThreadPoolExecutor:
    # A forked child has the parent's pool but not its threads: the process is part of the key.
    return ThreadPoolExecutor(count, thread_name_prefix="cadpose")
