"""How long each stage takes, and which one is at work."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager


class Stopwatch:
    """Adds up seconds by stage and knows the stage begun last."""

    def __init__(self, stage: str = "") -> None:
        self.seconds: dict[str, float] = {}
        self.stage = stage

    @contextmanager
    def time(self, stage: str) -> Iterator[None]:
        """Time what is done inside."""
        start = time.perf_counter()
        self.stage = stage
        try:
            yield
        finally:
            self.seconds[stage] = self.seconds.get(stage, 0.0) + time.perf_counter() - start
