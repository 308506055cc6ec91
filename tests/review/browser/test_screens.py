"""Every screen by axe, light and dark, wide and narrow; and what keys and fields do to each other."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.review.browser.browsing import Browser, Desk, missing, reviewing

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

DIALOGS = {
    "?": "Keys",
    "/": "Choose a model",
    "x": "Reject: why?",
    "i": "Statistics",
    "e": "Export",
    "u": "Add photos",
}


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing(browser: Browser, six: str, scheme: str) -> None:
    desk = browser.open(six, scheme=scheme)
    desk.drawn()
    desk.page.wait_for_selector(".tile img")
    assert desk.violations() == []
    for key, title in DIALOGS.items():
        desk.press(key)
        desk.dialog(title)
        if key == "/":
            desk.page.wait_for_selector(".model img")
        assert (title, desk.violations()) == (title, [])
        desk.press("Escape")
        desk.no_dialog()
    desk.press("Shift+ArrowUp", "m")
    desk.page.wait_for_selector(".region-tools")
    desk.button("Filter").click()
    assert desk.violations() == []
    desk.press("Escape")
    desk.page.locator(".author").click()
    desk.dialog("Your name")
    assert desk.violations() == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_narrow_screens_are_whole_and_clean(browser: Browser, six: str, scheme: str) -> None:
    desk = browser.open(six, size=(360, 740), scheme=scheme)
    desk.drawn()
    for tab in ("Adjust", "Models", "Details", "Queue"):
        desk.button(tab, ".tabs").click()
        assert (tab, desk.violations()) == (tab, [])
        assert desk.page.evaluate("document.documentElement.scrollWidth") <= 360
    desk.page.locator(".row").nth(1).click()
    desk.page.locator(".decision-bar .good").wait_for(state="visible")
    desk.page.locator(".decision-bar").get_by_role("button", name="Reject").click()
    desk.dialog("Reject: why?")
    assert desk.violations() == []


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_start_screen_says_what_is_missing(browser: Browser, tmp_path: Path, scheme: str) -> None:
    with reviewing(f"sqlite:///{tmp_path / 'empty.db'}", "--author", "Ada") as address:
        desk = browser.open(address, scheme=scheme)
        desk.page.get_by_role("heading", name="Nothing to review yet").wait_for()
        assert "cadpose library add" in desk.page.inner_text("main")
        assert desk.violations() == []


def test_keys_rest_in_fields_and_come_back(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    item = desk.drawn()
    desk.page.click("[data-field=elevation]")
    desk.page.fill("[data-field=elevation]", "33")
    desk.press("x", "Enter")
    assert desk.page.locator("dialog").count() == 0
    assert desk.number("elevation") == 33.0
    assert desk.page.evaluate("document.activeElement.classList.contains('view')")
    desk.press("ArrowUp")
    desk.becomes("elevation", 34.0)
    assert desk.item() == item
    _sliders_keep_their_arrows(desk)


def _sliders_keep_their_arrows(desk: Desk) -> None:
    azimuth = desk.number("azimuth")
    desk.page.get_by_label("Elevation, slider").focus()
    desk.press("ArrowLeft")
    desk.page.wait_for_function("() => document.querySelector('[data-field=elevation]').valueAsNumber < 34")
    assert desk.number("azimuth") == azimuth


def test_the_focus_goes_back_when_a_dialogue_closes(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    desk.drawn()
    desk.button("Statistics").focus()
    desk.press("Enter")
    desk.dialog("Statistics")
    desk.press("Escape")
    desk.no_dialog()
    assert desk.page.evaluate("document.activeElement.textContent") == "Statistics"


def test_a_server_that_is_gone_loses_nothing(browser: Browser, six: str) -> None:
    desk = browser.open(six, expected=("ERR_", "Failed to fetch"))
    item = desk.drawn()
    turned = desk.number("azimuth") + 10
    desk.press("Shift+ArrowRight")
    desk.becomes("azimuth", turned)
    desk.page.context.set_offline(True)
    desk.press("a")
    desk.notice("Not stored.")
    assert desk.item() == item
    desk.becomes("azimuth", turned)
    desk.page.context.set_offline(False)
    desk.button("Try again").click()
    desk.notice("Stored with your changes")


def test_box_and_mask_are_drawn_and_stored(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    item = desk.drawn()
    desk.press("b")
    desk.page.wait_for_selector(".region-tools")
    view = desk.page.locator(".view").bounding_box()
    x, y = view["x"] + view["width"] / 2, view["y"] + view["height"] / 2
    desk.page.get_by_role("group", name="Tool").get_by_role("button", name="Brush").click()
    desk.page.mouse.move(x, y)
    desk.page.mouse.down()
    desk.page.mouse.move(x + 60, y - 60, steps=6)
    desk.page.mouse.up()
    desk.button("Done").click()
    desk.press("a")
    desk.notice("Stored with your changes")
    told = desk.page.evaluate("async id => (await (await fetch('/api/annotations/' + id)).json())", item)
    assert told["history"][-1]["changed"] == ["region"]


def test_dropped_files_are_taken_or_told_about(browser: Browser, six: str) -> None:
    desk = browser.open(six, expected=("422",))
    desk.drawn()
    files = desk.page.evaluate_handle(
        """() => {
          const dropped = new DataTransfer();
          dropped.items.add(new File(['no photo'], 'notes.txt'));
          dropped.items.add(new File(['no photo either'], 'broken.jpg'));
          return dropped;
        }"""
    )
    desk.page.dispatch_event("body", "dragover", {"dataTransfer": files})
    desk.page.wait_for_selector(".drop-zone")
    desk.page.dispatch_event("body", "drop", {"dataTransfer": files})
    desk.dialog("Add photos")
    refused = desk.page.locator(".upload.failed")
    refused.nth(1).wait_for()
    assert desk.page.locator(".drop-zone").count() == 0
    assert "JPEG" in refused.nth(0).inner_text()
    assert "broken.jpg" in refused.nth(1).inner_text()


def test_an_export_of_nothing_is_told_on_the_page(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    desk.drawn()
    desk.press("e")
    dialog = desk.dialog("Export")
    dialog.get_by_role("button", name="Download").click()
    dialog.get_by_text("There is no object of that choice to export.").wait_for()
