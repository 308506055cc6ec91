"""Two people with one object open: nobody writes over what he has not seen, and nothing is lost."""

from __future__ import annotations

from typing import Any

import pytest

from tests.review.browser.browsing import Browser, Desk, missing

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

# The browser itself notes an answer of 409.
EXPECTED = ("409",)


def both(browser: Browser, address: str, *, turned: bool = True) -> tuple[Desk, Desk, str]:
    """Anna, who has turned it, and Ben at the same object; he has stored another model, turned around."""
    anna, ben = (browser.open(address, expected=EXPECTED) for _ in range(2))
    item = anna.drawn()
    assert ben.drawn() == item
    if turned:
        azimuth = anna.number("azimuth")
        anna.press("Shift+ArrowRight")
        anna.becomes("azimuth", azimuth + 10)
    ben.page.locator(".author").click()
    ben.page.fill("dialog input", "Ben")
    ben.press("Enter")
    ben.no_dialog()
    ben.press("2", "f", "a")
    ben.notice("Stored with your changes")
    return anna, ben, item


def stored(desk: Desk, item: str) -> dict[str, Any]:
    told: dict[str, Any] = desk.page.evaluate(
        "async id => (await fetch('/api/annotations/' + id)).json()", item
    )
    return told


def history(desk: Desk, item: str) -> list[dict[str, Any]]:
    return [each for each in stored(desk, item)["history"] if each["kind"] == "human"]


def test_theirs_is_loaded_and_ones_own_is_a_redo_away(browser: Browser, six: str) -> None:
    anna, _ben, item = both(browser, six)
    mine = anna.number("azimuth")
    anna.press("a")
    dialog = anna.dialog("Decided meanwhile")
    assert "Ben" in dialog.inner_text()
    assert "azimuth" in dialog.inner_text()
    assert len(history(anna, item)) == 1
    dialog.get_by_role("button", name="Load theirs").click()
    anna.notice("Redo brings your changes back")
    anna.drawn()
    assert anna.iou() > 0.0
    anna.becomes("azimuth", (mine - 10 + 180) % 360)
    anna.press("Control+y")
    anna.becomes("azimuth", mine)
    anna.press("a")
    anna.notice("Stored with your changes")
    assert [each["author"] for each in history(anna, item)] == ["Ben", "Ada"]


def test_ones_own_is_stored_on_top_and_both_stay_in_the_history(browser: Browser, six: str) -> None:
    anna, ben, item = both(browser, six)
    machine = stored(ben, item)["machine"]
    assert stored(ben, item)["cad"]["id"] != machine["cad"]["id"]
    anna.press("a")
    anna.dialog("Decided meanwhile").get_by_role("button", name="Apply mine on top").click()
    anna.notice("Stored with your changes")
    assert [(each["author"], each["verdict"]) for each in history(anna, item)] == [
        ("Ben", "edit"),
        ("Ada", "edit"),
    ]
    now = stored(anna, item)
    assert now["cad"]["id"] == machine["cad"]["id"]
    assert (now["pose"]["azimuth"] - machine["pose"]["azimuth"]) % 360 == pytest.approx(10.0, abs=1e-3)


def test_who_accepts_on_top_gets_what_stood_on_the_page(browser: Browser, six: str) -> None:
    anna, ben, item = both(browser, six, turned=False)
    machine = stored(ben, item)["machine"]
    anna.press("a")
    anna.dialog("Decided meanwhile").get_by_role("button", name="Apply mine on top").click()
    anna.notice("Stored with your changes")
    now = stored(anna, item)
    assert now["cad"]["id"] == machine["cad"]["id"]
    for name, value in machine["pose"].items():
        assert now["pose"][name] == pytest.approx(value), name


def test_a_draft_outlives_the_dialogue_and_other_items(browser: Browser, six: str) -> None:
    anna, _ben, item = both(browser, six)
    mine = anna.number("azimuth")
    anna.press("x")
    anna.dialog("Reject: why?")
    anna.press("2")
    anna.dialog("Decided meanwhile").get_by_role("button", name="Decide later").click()
    anna.no_dialog()
    anna.press("j")
    anna.drawn(item)
    assert anna.page.locator(".draft-dot").count() == 1
    anna.press("k")
    anna.page.wait_for_selector(f".stage[data-drawn='{item}']")
    anna.becomes("azimuth", mine)
    assert len(history(anna, item)) == 1
