"""How many requests are worked on at once: Python computes in one thread, and the more wait, the longer each.


Quick requests (the store) and slow ones (drawing, refining, exporting) have threads of their own, so that a
page full of thumbnails does not keep a decision waiting.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial, wraps
from typing import ParamSpec, TypeVar

from anyio import CapacityLimiter, to_thread
from fastapi import FastAPI

#: Threads of each kind.
QUICK, SLOW = 4, 6

P = ParamSpec("P")
R = TypeVar("R")


@asynccontextmanager
async def few_threads(app: FastAPI) -> AsyncIterator[None]:
    """An application's life in which plain functions share so many threads."""
    to_thread.current_default_thread_limiter().total_tokens = QUICK
    yield


class Slow:
    """Marks functions as slow; those of one mark share its threads.

    Args:
        count: Threads.
    """

    def __init__(self, count: int = SLOW) -> None:
        self._limiter = CapacityLimiter(count)

    def __call__(self, function: Callable[P, R]) -> Callable[P, Awaitable[R]]:
        """The function as one that is awaited, in a thread as soon as there is one."""

        @wraps(function)
        async def awaited(*arguments: P.args, **words: P.kwargs) -> R:
            return await to_thread.run_sync(partial(function, *arguments, **words), limiter=self._limiter)

        return awaited
