from __future__ import annotations

import multiprocessing
import subprocess
import sys
import threading
import time
import warnings

import pytest

from cadpose import threads


@pytest.fixture
def two(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "_allowed", 2)


@pytest.mark.usefixtures("two")
def test_work_is_spread_and_answers_keep_their_order() -> None:
    meeting = threading.Barrier(2, timeout=10)

    def work(item: int) -> int:
        meeting.wait()  # passes only if two are at work at once
        time.sleep(0.01 * (item % 2))
        return item * item

    assert threads.spread(work, range(6)) == [0, 1, 4, 9, 16, 25]


@pytest.mark.usefixtures("two")
def test_work_within_work_stays_on_its_thread() -> None:
    def name(_: int) -> str:
        return threading.current_thread().name

    found = threads.spread(lambda n: {name(n), *threads.spread(name, range(3))}, range(4))
    assert all(len(names) == 1 for names in found)


@pytest.mark.usefixtures("two")
def test_an_error_comes_through() -> None:
    with pytest.raises(ZeroDivisionError):
        threads.spread(lambda n: 1 // n, [1, 0])


def test_one_thread_and_one_item_stay_here(monkeypatch: pytest.MonkeyPatch) -> None:
    def here(_: int) -> str:
        return threading.current_thread().name

    mine = threading.current_thread().name
    monkeypatch.setattr(threads, "_allowed", 1)
    assert threads.spread(here, range(3)) == [mine] * 3
    monkeypatch.setattr(threads, "_allowed", 2)
    assert threads.spread(here, [7]) == [mine]


@pytest.mark.usefixtures("two")
def test_one_thread_can_be_asked_for() -> None:
    mine = threading.current_thread().name
    with threads.on_one_thread():
        assert threads.spread(lambda _: threading.current_thread().name, range(3)) == [mine] * 3
    assert mine not in threads.spread(lambda _: threading.current_thread().name, range(3))


@pytest.mark.parametrize("allowed", [1, 2, 3])
@pytest.mark.parametrize("count", [0, 1, 2, 7])
def test_shares_cover_every_row_once(count: int, allowed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(threads, "_allowed", allowed)
    parts = threads.shares(count)
    assert [n for part in parts for n in range(count)[part]] == list(range(count))
    assert len(parts) <= allowed


def _squares() -> list[int]:
    return threads.spread(lambda n: n * n, range(5))


@pytest.mark.usefixtures("two")
@pytest.mark.skipif("fork" not in multiprocessing.get_all_start_methods(), reason="needs fork")
def test_a_forked_child_has_threads_of_its_own() -> None:
    assert _squares() == [0, 1, 4, 9, 16]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of forking where there are threads
        with multiprocessing.get_context("fork").Pool(1) as pool:
            assert pool.apply_async(_squares).get(timeout=30) == [0, 1, 4, 9, 16]


def test_work_goes_on_while_the_interpreter_goes_down() -> None:
    program = (
        "import atexit; from cadpose import threads; threads._allowed = 2\n"
        "atexit.register(lambda: print(threads.spread(lambda n: n + 1, range(3))))\n"
        "threads.spread(abs, range(3))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[1, 2, 3]"
