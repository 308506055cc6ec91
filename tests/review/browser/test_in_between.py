"""What is done while the next object is on its way belongs to the one that is seen, or to none."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from tests.review.browser.browsing import Browser, Desk, missing
from tests.review.browser.test_two_people import history, stored

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]


def test_the_wheel_belongs_to_the_object_under_it(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    first = desk.drawn()
    focal = desk.number("focal_px")
    _over_the_photo(desk)
    desk.page.mouse.wheel(0, -240)
    desk.page.wait_for_function(
        "before => document.querySelector('[data-field=focal_px]').valueAsNumber !== before", arg=focal
    )
    zoomed = desk.number("focal_px")
    desk.press("j")
    second = desk.drawn(first)
    # Longer than the wheel takes to rest.
    desk.page.wait_for_timeout(600)
    assert desk.number("focal_px") == pytest.approx(stored(desk, second)["pose"]["focal_px"], abs=0.51)
    assert desk.page.locator(".draft-dot").count() == 1
    desk.press("k")
    desk.page.wait_for_selector(f".stage[data-drawn='{first}']")
    desk.becomes("focal_px", zoomed)


def test_nothing_is_done_to_an_object_that_is_not_seen(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    first = desk.drawn()
    # Far enough down not to be fetched ahead.
    other = str(desk.page.locator("[data-annotation]").nth(5).get_attribute("data-annotation"))
    let_go = _hold_photos(desk)
    desk.page.evaluate("id => { location.hash = '#/' + id; }", other)
    azimuth = stored(desk, other)["pose"]["azimuth"] % 360
    desk.becomes("azimuth", azimuth)
    assert desk.page.locator(".decision-bar .good").is_disabled()
    desk.press("a", "Shift+ArrowRight", "f", "2")
    _over_the_photo(desk)
    desk.page.mouse.down()
    desk.page.mouse.move(700, 400, steps=4)
    desk.page.mouse.up()
    desk.page.mouse.wheel(0, -240)
    desk.page.wait_for_timeout(600)
    assert let_go() > 0
    desk.page.wait_for_selector(f".stage[data-drawn='{other}']")
    assert desk.item() == other
    desk.becomes("azimuth", azimuth)
    assert desk.page.locator(".draft-dot").count() == 0
    assert history(desk, first) == history(desk, other) == []


def test_a_slider_that_is_held_stays_with_its_object(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    first = desk.drawn()
    azimuth = desk.number("azimuth")
    box = desk.page.get_by_label("Azimuth, slider").bounding_box()
    y = box["y"] + box["height"] / 2
    desk.page.mouse.move(box["x"] + box["width"] * 0.3, y)
    desk.page.mouse.down()
    desk.page.mouse.move(box["x"] + box["width"] * 0.5, y, steps=3)
    desk.page.wait_for_function(
        "before => document.querySelector('[data-field=azimuth]').valueAsNumber !== before", arg=azimuth
    )
    slid = desk.number("azimuth")
    desk.press("j")
    second = desk.drawn(first)
    desk.page.mouse.move(box["x"] + box["width"] * 0.8, y, steps=3)
    desk.page.mouse.up()
    desk.becomes("azimuth", stored(desk, second)["pose"]["azimuth"] % 360)
    assert desk.page.locator(".draft-dot").count() == 1
    desk.press("k")
    desk.page.wait_for_selector(f".stage[data-drawn='{first}']")
    desk.becomes("azimuth", slid)


def test_who_comes_back_before_the_next_is_drawn_sees_the_former(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    first = desk.drawn()
    iou, azimuth = desk.iou(), desk.number("azimuth")
    other = str(desk.page.locator("[data-annotation]").nth(5).get_attribute("data-annotation"))
    let_go = _hold_photos(desk)
    desk.page.evaluate("id => { location.hash = '#/' + id; }", other)
    desk.becomes("azimuth", stored(desk, other)["pose"]["azimuth"] % 360)
    desk.page.evaluate("id => { location.hash = '#/' + id; }", first)
    desk.becomes("azimuth", azimuth)
    assert let_go() > 0
    desk.page.wait_for_timeout(1000)
    assert desk.drawn() == first
    assert desk.iou() == pytest.approx(iou, abs=0.01)


def _hold_photos(desk: Desk) -> Callable[[], int]:
    """Let no photo arrive until what this gives is called, which tells how many were held back."""
    held: list[Any] = []
    holding = True

    def asked(route: Any) -> None:
        if holding:
            held.append(route)
        else:
            route.continue_()

    def let_go() -> int:
        nonlocal holding
        holding = False
        for route in held:
            route.continue_()
        return len(held)

    desk.page.route("**/api/photos/*/image*", asked)
    return let_go


def _over_the_photo(desk: Desk) -> None:
    box = desk.page.locator(".view").bounding_box()
    desk.page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
