"""Another model in the object's place, and the rotations at which a symmetric model looks alike."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import trimesh

from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from tests.review.browser.browsing import Browser, missing, reviewing
from tests.review.browser.making import make_store

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]


def test_an_object_is_replaced_as_it_stands_on_the_page(browser: Browser, six: str) -> None:
    desk = browser.open(six)
    desk.drawn()
    azimuth = desk.number("azimuth")
    desk.press("Shift+ArrowRight", "2")
    desk.becomes("azimuth", azimuth + 10)
    desk.press("g")
    dialog = desk.page.locator("dialog")
    dialog.locator(".model").first.click()
    with desk.page.expect_request("**/replace") as asked:
        dialog.get_by_role("button", name="Replace", exact=True).click()
    body = json.loads(asked.value.post_data)
    assert (body["now"]["pose"]["azimuth"] - azimuth) % 360 == pytest.approx(10.0, abs=0.1)
    assert body["now"]["cad_id"] != body["cad_id"]
    assert "pose" not in body
    dialog.get_by_text("Made in").wait_for()
    with desk.page.expect_download() as scene:
        dialog.get_by_role("link", name="Scene (GLB)").click()
    assert Path(scene.value.path()).read_bytes()[:4] == b"glTF"
    desk.page.wait_for_function(
        "() => [...document.querySelectorAll('dialog img')].every(each => each.naturalWidth > 0)"
    )


def test_twins_of_a_symmetric_model_are_offered(browser: Browser, tmp_path: Path) -> None:
    """A crate looks the same from behind."""
    (tmp_path / "models" / "car").mkdir(parents=True)
    crate = trimesh.creation.box(extents=(1.0, 0.7, 2.0))
    crate.export(tmp_path / "models" / "car" / "crate.obj")
    library = Library.create(tmp_path / "library")
    add_path(library, tmp_path / "models")
    store = make_store(tmp_path, library, photos=1, size=(320, 240))
    with reviewing(
        store, "--photos", tmp_path / "photos", "--library", library.path, "--author", "Ada"
    ) as address:
        desk = browser.open(address)
        desk.drawn()
        before, iou = desk.number("azimuth"), desk.iou()
        strip = desk.page.locator(".strip[aria-label^='Looks alike']")
        strip.wait_for()
        behind = f"azimuth {round((before + 180) % 360) % 360}°"
        tile = strip.locator(".tile", has_text=behind).first
        tile.locator("img").wait_for()
        tile.click()
        desk.becomes("azimuth", before + 180)
        assert desk.iou() == pytest.approx(iou, abs=0.02)
        desk.press("a")
        desk.notice("Stored with your changes")
