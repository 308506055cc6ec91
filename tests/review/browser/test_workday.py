"""A newcomer's way from an empty store to a file for others, as a person would go it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from cadpose.annotations.store import Selection, Store
from cadpose.library.catalogue import Library
from tests.review.browser.browsing import Browser, Desk, missing, reviewing

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]


def test_from_an_empty_store_to_an_export(browser: Browser, real_library: Library, tmp_path: Path) -> None:
    data = pytest.importorskip("skimage.data", reason="needs cadpose[demo]")
    image = pytest.importorskip("PIL.Image")
    photos = [tmp_path / "coffee.png", tmp_path / "motorcycle.png"]
    image.fromarray(data.coffee()).save(photos[0])
    image.fromarray(data.stereo_motorcycle()[0]).save(photos[1])
    (tmp_path / "notes.txt").write_text("not a photo")
    url = f"sqlite:///{tmp_path / 'new' / 'store.db'}"
    (tmp_path / "new").mkdir()

    with reviewing(url, "--library", real_library.path, "--author", "Ada") as address:
        desk = browser.open(address)
        desk.page.get_by_role("heading", name="Nothing to review yet").wait_for()
        desk.page.set_input_files("[data-upload=files]", [*map(str, photos), str(tmp_path / "notes.txt")])
        desk.page.locator(".upload.failed", has_text="notes.txt").wait_for()
        first = desk.drawn()
        desk.page.wait_for_function("() => document.querySelectorAll('.row').length >= 2")
        desk.press("u")
        desk.page.locator(".upload.done", has_text="motorcycle.png").wait_for()
        desk.page.locator(".upload.done", has_text="coffee.png").wait_for()
        desk.press("Escape")
        desk.no_dialog()

        turned = _by_mouse(desk)
        second = desk.drawn(first)
        model = _by_keys(desk)
        desk.page.reload()
        desk.page.wait_for_selector(".row")
        desk.page.evaluate("id => { location.hash = '#/' + id; }", first)
        desk.page.wait_for_selector(f".stage[data-drawn='{first}']")
        desk.becomes("azimuth", turned)
        assert (
            desk.page.locator(".history li").first.inner_text().startswith("Corrected by Ada, changed pose")
        )

        with desk.page.expect_download() as download:
            desk.press("e")
            desk.dialog("Export").get_by_label("COCO").check()
            desk.page.get_by_role("button", name="Download").click()
        download.value.save_as(tmp_path / "coco.json")

    with Store(url) as store:
        assert {item.annotation_id for item in store.queue(Selection(decided_by="human"), limit=9).items} == {
            first,
            second,
        }
        edited = store.stored(second)
        assert edited is not None
        assert edited.annotation.cad.name == model
        before = store.stored(second, original=True)
        assert before is not None
        assert before.annotation.cad.name != model
        names = {_photo_name(store, key) for key in (first, second)}
    told = json.loads((tmp_path / "coco.json").read_text())
    assert len(told["annotations"]) == 2
    assert {image["file_name"].rpartition("/")[2] for image in told["images"]} == names


def _photo_name(store: Store, key: str) -> str:
    found = store.stored(key)
    assert found is not None
    return found.annotation.photo_name.rpartition("/")[2]


def _by_mouse(desk: Desk) -> float:
    """Drag the model about, wipe, and store; the azimuth that was stored."""
    before = desk.number("azimuth"), desk.number("elevation"), desk.number("focal_px")
    box = desk.page.locator(".view").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    desk.page.mouse.move(x, y)
    desk.page.mouse.down()
    desk.page.mouse.move(x + 40, y + 12, steps=5)
    desk.page.mouse.up()
    desk.page.wait_for_function(
        "before => document.querySelector('[data-field=azimuth]').valueAsNumber !== before", arg=before[0]
    )
    desk.page.mouse.wheel(0, -240)
    desk.page.wait_for_function(
        "before => document.querySelector('[data-field=focal_px]').valueAsNumber !== before", arg=before[2]
    )
    # The wheel has come to rest, and is a step of undo.
    desk.page.wait_for_timeout(600)
    turned, zoomed = desk.number("azimuth"), desk.number("focal_px")
    desk.button("Undo").click()
    desk.becomes("focal_px", before[2])
    desk.button("Redo").click()
    desk.becomes("focal_px", zoomed)
    desk.page.locator(".decision-bar .good").click()
    desk.notice("Stored with your changes")
    return turned


def _by_keys(desk: Desk) -> str:
    """Other model, turns, snap, store, without the mouse; the model's name."""
    desk.press("2")
    desk.page.wait_for_function(
        "() => document.querySelector('.strip').querySelectorAll('.tile')[1]?.ariaPressed === 'true'"
    )
    name = str(desk.page.locator(".strip").first.locator(".tile[aria-pressed=true] .tile-name").inner_text())
    azimuth = desk.number("azimuth")
    desk.press("Shift+ArrowRight", "ArrowRight", "ArrowUp", ",", "+")
    desk.becomes("azimuth", azimuth + 11)
    desk.press("f")
    desk.becomes("azimuth", azimuth + 191)
    desk.press("Control+z")
    desk.becomes("azimuth", azimuth + 11)
    desk.press("s")
    desk.notice("Snapped in")
    desk.press("a")
    desk.notice("Stored with your changes")
    return name
