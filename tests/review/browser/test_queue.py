"""A thousand objects: the list scrolls, and each opens at once."""

from __future__ import annotations

import logging
import statistics
from pathlib import Path

import pytest

from cadpose.library.catalogue import Library
from tests.review.browser.browsing import Browser, Desk, missing, reviewing
from tests.review.browser.making import make_store

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

log = logging.getLogger(__name__)
#: The aim is 200 ms on a machine of one's own, see scripts/review_timing.py; those of tests are shared.
LOOSE_MS = 3000.0


def test_a_thousand_items(browser: Browser, small_library: Library, tmp_path: Path) -> None:
    store = make_store(tmp_path, small_library, photos=125, each=8, size=(320, 240))
    with reviewing(
        store, "--photos", tmp_path / "photos", "--library", small_library.path, "--author", "Ada"
    ) as address:
        desk = browser.open(address)
        desk.drawn()
        assert "1,000" in desk.page.inner_text(".queue h2")
        _scroll(desk)
        _open_twenty(desk)


def _scroll(desk: Desk) -> None:
    """To the end and back; only what is in sight is in the page."""
    desk.page.evaluate("document.querySelector('.virtual-list').scrollTop = 1e9")
    desk.page.wait_for_selector("[aria-posinset='1000'] [data-annotation]")
    assert desk.page.locator(".row").count() < 60
    frames = desk.page.evaluate(
        """async () => {
          const list = document.querySelector('.virtual-list'), times = [];
          let last = performance.now();
          for (let at = list.scrollTop; at > 0; at -= 400) {
            list.scrollTop = at;
            await new Promise(requestAnimationFrame);
            const now = performance.now();
            times.push(now - last);
            last = now;
          }
          list.scrollTop = 0;
          return times;
        }"""
    )
    log.info("scrolling: %d frames, median %.0f ms", len(frames), statistics.median(frames))
    assert statistics.median(frames) < 1000.0
    desk.page.wait_for_selector("[aria-posinset='1'] [data-annotation]")


def _open_twenty(desk: Desk) -> None:
    desk.page.evaluate("performance.clearMeasures()")
    for _ in range(20):
        before = desk.item()
        desk.page.wait_for_timeout(700)
        desk.press("j")
        desk.drawn(before)
    times = desk.opening_times()
    log.info("opening: median %.0f ms, slowest %.0f ms", statistics.median(times), max(times))
    assert len(times) == 20
    assert max(times) < LOOSE_MS
