"""How many requests are worked on at once.

Python computes in one thread at a time, so more threads only make each request take longer. Quick requests
(the store) and slow ones (drawing, refining, exporting) have separate threads: a page full of thumbnails does
not keep a decision waiting. Work of which one at a time is enough waits without holding a thread.
"""

from __future__ import annotations

from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial, wraps
from typing import ParamSpec, TypeVar

from anyio import CapacityLimiter, Lock, fail_after, to_thread
from fastapi import FastAPI, Request

from cadpose.review.refusals import RefusedError

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

    Attributes:
        limiter: Of these threads.
    """

    def __init__(self, count: int = SLOW) -> None:
        self.limiter = CapacityLimiter(count)

    def __call__(self, function: Callable[P, R]) -> Callable[P, Awaitable[R]]:
        """The function as one that is awaited, in a thread as soon as there is one."""

        @wraps(function)
        async def awaited(*arguments: P.args, **words: P.kwargs) -> R:
            return await self.run(function, *arguments, **words)

        return awaited

    async def run(self, function: Callable[P, R], *arguments: P.args, **words: P.kwargs) -> R:
        """One call of a function, in a thread as soon as there is one."""
        return await to_thread.run_sync(partial(function, *arguments, **words), limiter=self.limiter)


class Turn:
    """Work that is done for one request at a time; the others wait in the event loop, without a thread.

    Args:
        patience: Seconds that a request waits.
        sentence: What it is told then.
    """

    def __init__(self, patience: float, sentence: str) -> None:
        self.patience, self._sentence = patience, sentence
        self._lock = Lock()

    @asynccontextmanager
    async def of(self, request: Request) -> AsyncIterator[None]:
        """The request's turn, until the block ends.

        Raises:
            RefusedError: it did not come in time, or whoever asked has gone meanwhile.
        """
        try:
            with fail_after(self.patience):
                await self._lock.acquire()
        except TimeoutError:
            raise RefusedError("busy", self._sentence) from None
        try:
            # A page that turns a model on gives up the snap before: nobody waits for it any more.
            if await request.is_disconnected():
                raise RefusedError("busy", "the request was given up")
            yield
        finally:
            self._lock.release()
