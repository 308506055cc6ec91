"""Boxes and masks drawn over the view with mouse and keys, in headless Chromium."""

from __future__ import annotations

import base64
from collections.abc import Iterator

import numpy as np
import pytest

from cadpose.records import Mask
from tests.review.view_page import ViewPage, missing, view_page

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

WIDTH, HEIGHT = 321, 241


@pytest.fixture(scope="module")
def opened() -> Iterator[ViewPage]:
    with view_page() as page:
        yield page
        assert page.said == []


@pytest.fixture
def edited(opened: ViewPage) -> ViewPage:
    """An editor over an empty photo."""
    opened.page.evaluate(
        """async ([w, h]) => {
            window.editor?.dispose();
            await view.setPhoto(null, w, h);
            view.focusOn(null);
            window.regions = [];
            window.editor = new RegionEditor(place, { onChange(box, mask) { regions.push([box, mask]); } });
        }""",
        [WIDTH, HEIGHT],
    )
    return opened


def at(edited: ViewPage, x: float, y: float) -> tuple[float, float]:
    """Where a pixel of the photo is on the page."""
    found = edited.page.evaluate("point => view.toScreen(point)", [x, y])
    return found[0], found[1]


def drag(edited: ViewPage, start: tuple[float, float], end: tuple[float, float]) -> None:
    mouse = edited.page.mouse
    mouse.move(*at(edited, *start))
    mouse.down()
    mouse.move(*at(edited, *end), steps=5)
    mouse.up()


def told(edited: ViewPage) -> tuple[list[float] | None, Mask | None]:
    """The last box and mask."""
    box, mask = edited.page.evaluate(
        "() => { const [box, mask] = regions.at(-1); return [box, mask && text(mask)] }"
    )
    if mask is None:
        return box, None
    return box, np.frombuffer(base64.b64decode(mask), np.uint8).reshape(HEIGHT, WIDTH) == 1


def tab_to(edited: ViewPage, name: str) -> None:
    for _ in range(60):
        edited.page.keyboard.press("Tab")
        if edited.page.evaluate("document.activeElement.getAttribute('aria-label')") == name:
            return
    raise AssertionError(f"Tab does not reach {name}")


def disc(radius: float) -> Mask:
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    inside: Mask = np.hypot(x + 0.5 - 160, y + 0.5 - 120) < radius
    return inside


def set_region(edited: ViewPage, box: list[float] | None, mask: Mask | None) -> None:
    rows = None if mask is None else "".join(map(str, mask.astype(int).ravel()))
    edited.page.evaluate(
        "([box, rows]) => editor.setRegion(box, rows && Uint8Array.from(rows, Number))", [box, rows]
    )


def iou(a: Mask, b: Mask) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_a_box_is_drawn_moved_and_dragged_by_its_handles(edited: ViewPage) -> None:
    drag(edited, (200, 150), (100, 50))
    box, mask = told(edited)
    assert box == pytest.approx([100, 50, 200, 150], abs=0.5) and mask is None
    drag(edited, (100, 50), (80, 40))
    assert told(edited)[0] == pytest.approx([80, 40, 200, 150], abs=1.0)
    drag(edited, (200, 95), (240, 95))
    assert told(edited)[0] == pytest.approx([80, 40, 240, 150], abs=1.0)
    # By its line, as far as the photo goes.
    drag(edited, (120, 40), (20, -30))
    assert told(edited)[0] == pytest.approx([0, 0, 160, 110], abs=1.5)
    assert edited.page.evaluate("regions.length") == 4


def test_a_box_is_moved_by_keys(edited: ViewPage) -> None:
    set_region(edited, [100, 50, 200, 150], None)
    tab_to(edited, "Box, bottom right corner")
    edited.page.keyboard.press("ArrowRight")
    edited.page.keyboard.press("Shift+ArrowDown")
    assert told(edited)[0] == [100, 50, 201, 160]
    tab_to(edited, "Whole box")
    edited.page.keyboard.press("Shift+ArrowLeft")
    assert told(edited)[0] == [90, 50, 191, 160]
    edited.page.evaluate("editor.undo(); editor.undo()")
    assert told(edited)[0] == [100, 50, 201, 150]
    edited.page.evaluate("editor.redo()")
    assert told(edited)[0] == [100, 50, 201, 160]


def test_a_polygon_is_drawn_point_by_point(edited: ViewPage) -> None:
    edited.page.evaluate("editor.newRing()")
    for x, y in ((50, 40), (250, 40), (250, 200), (50, 200)):
        edited.page.mouse.click(*at(edited, x, y))
    edited.page.mouse.click(*at(edited, 50, 40))
    box, mask = told(edited)
    assert mask is not None and abs(int(mask.sum()) - 200 * 160) < 400
    assert box == pytest.approx([50, 40, 250, 200], abs=0.5)
    # A ring within it is a hole; Enter closes it.
    edited.page.evaluate("editor.newRing()")
    for x, y in ((100, 80), (200, 80), (200, 160), (100, 160)):
        edited.page.mouse.click(*at(edited, x, y))
    edited.page.evaluate(
        "document.querySelector('svg').dispatchEvent(new KeyboardEvent('keydown', {key: 'Enter'}))"
    )
    _, mask = told(edited)
    assert mask is not None and abs(int(mask.sum()) - (200 * 160 - 100 * 80)) < 500
    assert not mask[120, 150] and mask[60, 60]


def test_points_are_added_moved_and_deleted(edited: ViewPage) -> None:
    square = np.zeros((HEIGHT, WIDTH), np.bool_)
    square[50:150, 100:200] = True
    set_region(edited, [100, 50, 200, 150], square)
    edited.page.evaluate("editor.setTool('polygon')")
    # From the middle of the upper edge a new point goes up.
    drag(edited, (150, 50), (150, 10))
    _, mask = told(edited)
    assert mask is not None and mask[30, 150] and not mask[30, 120]
    drag(edited, (150, 10), (150, 30))
    _, mask = told(edited)
    assert mask is not None and not mask[20, 150] and mask[40, 150]
    edited.page.mouse.dblclick(*at(edited, 150, 30))
    _, mask = told(edited)
    assert mask is not None and iou(mask, square) == 1.0
    tab_to(edited, "Polygon 1, point 2 of 4")
    edited.page.keyboard.press("Shift+ArrowRight")
    _, mask = told(edited)
    assert mask is not None and mask[51, 205]
    edited.page.keyboard.press("Insert")
    edited.page.keyboard.press("Delete")
    edited.page.keyboard.press("Delete")
    _, mask = told(edited)
    assert mask is not None and abs(int(mask.sum()) - 5000) < 700


def test_a_mask_becomes_polygons_that_make_it_again(edited: ViewPage) -> None:
    ring = disc(90) & ~disc(40)
    set_region(edited, [70, 30, 250, 210], ring)
    assert edited.page.evaluate("regions.length") == 0
    edited.page.evaluate("editor.setTool('polygon')")
    count = edited.page.locator("svg [aria-label^='Polygon 1, point']").count()
    assert 8 <= count <= 80
    assert edited.page.locator("svg [aria-label^='Polygon 2, point']").count() >= 8
    tab_to(edited, f"Polygon 1, point 1 of {count}")
    edited.page.keyboard.press("ArrowUp")
    _, mask = told(edited)
    assert mask is not None and iou(mask, ring) > 0.97


def test_a_brush_adds_and_an_eraser_takes_away(edited: ViewPage) -> None:
    set_region(edited, None, disc(40))
    edited.page.evaluate("editor.setTool('brush'); editor.brushSize = 12")
    drag(edited, (160, 120), (260, 120))
    box, mask = told(edited)
    assert mask is not None and mask[120, 265] and mask[110, 240] and not mask[100, 240]
    assert box is not None
    edited.page.evaluate("editor.setTool('erase')")
    drag(edited, (160, 70), (160, 170))
    _, mask = told(edited)
    assert mask is not None and not mask[120, 160] and mask[120, 180]
    edited.page.evaluate("editor.undo()")
    _, mask = told(edited)
    assert mask is not None and mask[120, 160]


def test_the_photo_moves_under_the_region(edited: ViewPage) -> None:
    set_region(edited, [100, 50, 200, 150], None)
    edited.page.mouse.move(*at(edited, 150, 100))
    edited.page.mouse.wheel(0, -400)
    edited.page.wait_for_function("() => view.zoom > 1.5")
    left, top = at(edited, 100, 50)
    corner = edited.page.get_by_role("button", name="Box, top left corner").bounding_box()
    assert corner["x"] + corner["width"] / 2 == pytest.approx(left, abs=1.0)
    assert corner["y"] + corner["height"] / 2 == pytest.approx(top, abs=1.0)
    edited.page.evaluate("editor.dispose(); window.editor = null")
    assert edited.page.locator("svg").count() == 0
