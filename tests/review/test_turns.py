"""Who waits for whom, and without a thread."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import anyio
import pytest
from starlette.requests import Request

from cadpose.replacement.replacer import Replacer
from cadpose.review import exporting as exporting_module
from cadpose.review.refusals import RefusedError
from cadpose.review.turns import SLOW, Turn
from tests.review.serving import Served


def request(gone: bool = False) -> Request:
    async def receive() -> Any:
        if not gone:
            await anyio.sleep_forever()
        return {"type": "http.disconnect"}

    return Request({"type": "http", "headers": []}, receive)


def test_one_at_a_time_and_not_for_ever() -> None:
    turn, together, most = Turn(5.0, "later"), 0, 0

    async def work() -> None:
        nonlocal together, most
        async with turn.of(request()):
            together += 1
            most = max(most, together)
            await anyio.sleep(0.01)
            together -= 1

    async def all_of_them() -> None:
        async with anyio.create_task_group() as group:
            for _ in range(5):
                group.start_soon(work)
        hurried = Turn(0.05, "later")
        over = anyio.Event()

        async def hold() -> None:
            async with hurried.of(request()):
                await over.wait()

        async with anyio.create_task_group() as group:
            group.start_soon(hold)
            await anyio.sleep(0.01)
            with pytest.raises(RefusedError, match="later") as refused:
                async with hurried.of(request()):
                    raise AssertionError
            assert refused.value.kind == "busy"
            over.set()
        async with hurried.of(request()):
            pass

    anyio.run(all_of_them)
    assert most == 1


def test_who_has_gone_gets_no_turn() -> None:
    async def both() -> None:
        turn = Turn(5.0, "later")
        with pytest.raises(RefusedError, match="given up"):
            async with turn.of(request(gone=True)):
                raise AssertionError
        async with turn.of(request()):
            pass

    anyio.run(both)


def snap(served: Served) -> Any:
    found = served.get(f"/api/annotations/{served.ids()[0]}")
    body = {"annotation_id": found["id"], "cad_id": found["cad"]["id"], "pose": found["pose"]}
    return served.client.post("/api/snap", json=body)


def replaced(served: Served) -> Any:
    return served.client.post(
        f"/api/annotations/{served.ids()[0]}/replace", json={"cad_id": "made/car/van.glb"}
    )


def exported(served: Served) -> Any:
    return served.client.get("/api/export/csv")


@pytest.mark.parametrize("ask", [snap, replaced, exported])
def test_those_who_wait_take_no_thread(
    served: Served, monkeypatch: pytest.MonkeyPatch, ask: Callable[[Served], Any]
) -> None:
    """With more that wait than there are slow threads, a thumbnail still comes at once."""
    begun, go_on, calls = threading.Event(), threading.Event(), []

    def held(*arguments: Any, **words: Any) -> Any:
        calls.append(1)
        begun.set()
        go_on.wait(20)
        raise RefusedError("bad_input", "held")

    monkeypatch.setattr(served.desk.studio, "snap", held)
    monkeypatch.setattr(Replacer, "replace", held)
    monkeypatch.setattr(exporting_module, "export", held)
    thumb = served.get("/api/queue")["items"][0]["thumb"]
    # One event loop for all, as in a server.
    with served.client, ThreadPoolExecutor(SLOW + 2) as pool:
        waiting = [pool.submit(ask, served) for _ in range(SLOW + 2)]
        try:
            assert begun.wait(10)
            time.sleep(0.3)
            assert len(calls) == 1 and served.desk.slow.limiter.borrowed_tokens == 1
            assert served.client.get(thumb).status_code == 200
        finally:
            go_on.set()
        assert [answer.result(20).status_code for answer in waiting] == [422] * (SLOW + 2)
    assert len(calls) == SLOW + 2
