"""The review page's view alone: the committed bundle in headless Chromium, under the page's own policy."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from cadpose.poses import Pose4Dof
from cadpose.records import Mask
from cadpose.review.security import CONTENT_SECURITY_POLICY
from tests.annotations.scenes.viewer import FLAGS, chromium

WIDGET = Path(__file__).parents[2] / "src" / "cadpose" / "review" / "static" / "widget.js"
_ORIGIN = "http://view.invalid"
_HTML = """<!doctype html><meta charset="utf-8"><title>view</title><link rel="stylesheet" href="/page.css">
<div id="view"></div><script type="module" src="/page.js"></script>"""
_CSS = "html, body { margin: 0; height: 100% } #view { position: relative; height: 100%; background: #222 }"
_JS = """
import widget, { PhotoView, RegionEditor } from "/widget.js";
const place = document.getElementById("view");
Object.assign(window, { widget, PhotoView, RegionEditor, place, poses: [], wipes: [] });
window.view = new PhotoView(place, {
  onPose(pose, done) { poses.push([pose, done]); },
  onWipe(wipe) { wipes.push(wipe); },
});
window.text = (data) => {
  let out = "";
  for (let i = 0; i < data.length; i += 8192) out += String.fromCharCode(...data.subarray(i, i + 8192));
  return btoa(out);
};
window.ready = true;
"""


def missing() -> str:
    """What is not there, as one sentence; empty when all is."""
    if chromium() is None:
        return "needs Chromium: run `make browser`"
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "needs playwright: run `make browser`"
    if not WIDGET.is_file():
        return "needs the built page: run `make web`"
    return ""


@dataclass(frozen=True, eq=False)
class ViewPage:
    """A page that a PhotoView fills.

    Attributes:
        page: Playwright's.
        files: What the page may fetch, by its path; the bytes are made when asked for.
        said: What the page wrote to its console, and its errors.
    """

    page: Any
    files: dict[str, Callable[[], bytes]]
    said: list[str]

    def show(self, model: bytes | None, pose: Pose4Dof | None, width: int, height: int) -> None:
        """A photo of that size without a picture, with the model at the pose."""
        self.page.evaluate("([w, h]) => view.setPhoto(null, w, h)", [width, height])
        if model is not None:
            path = f"/models/{len(self.files)}.glb"
            self.files[path] = lambda: model
            self.page.evaluate("path => view.setModel(path)", path)
        if pose is not None:
            self.page.evaluate("pose => view.setPose(pose)", pose_told(pose))

    def silhouette(self) -> Mask:
        """(H, W) bool of the photo's size."""
        told = self.page.evaluate(
            "() => { const s = view.silhouette(); return [s.height, s.width, text(s.data)] }"
        )
        height, width, data = told
        mask: Mask = np.frombuffer(base64.b64decode(data), np.uint8).reshape(height, width) == 1
        return mask

    def picture(self) -> NDArray[np.uint8]:
        """(H, W, 3) uint8 of the page as it is seen."""
        self.page.evaluate("() => view.drawNow()")
        return np.array(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"))


def pose_told(pose: Pose4Dof) -> dict[str, Any]:
    """As the page wants it."""
    rotation = pose.rotation
    return {
        "azimuth": rotation.azimuth,
        "elevation": rotation.elevation,
        "inplane": rotation.inplane,
        "focal_px": pose.focal_px,
        "principal_px": list(pose.principal_px),
        "t_z": pose.t_z,
    }


@contextmanager
def view_page(
    width: int = 800, height: int = 600, *, ratio: float = 1.0, flags: list[str] | None = None, **context: Any
) -> Iterator[ViewPage]:
    """Start Chromium with the page; nothing outside this machine is asked for anything."""
    from playwright.sync_api import Route, sync_playwright

    files: dict[str, Callable[[], bytes]] = {}
    own = {
        "/": (_HTML.encode(), "text/html"),
        "/page.css": (_CSS.encode(), "text/css"),
        "/page.js": (_JS.encode(), "text/javascript"),
        "/widget.js": (WIDGET.read_bytes(), "text/javascript"),
    }

    def serve(route: Route) -> None:
        path = route.request.url.removeprefix(_ORIGIN)
        policy = {"Content-Security-Policy": CONTENT_SECURITY_POLICY}
        if path in own:
            body, kind = own[path]
            route.fulfill(body=body, content_type=kind, headers=policy)
        elif path in files:
            route.fulfill(body=files[path](), content_type="application/octet-stream")
        else:
            route.fulfill(status=404)

    said: list[str] = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium(), args=FLAGS if flags is None else flags
        )
        try:
            size = {"width": width, "height": height}
            page = browser.new_context(viewport=size, device_scale_factor=ratio, **context).new_page()
            page.on("console", lambda message: said.append(message.text))
            page.on("pageerror", lambda error: said.append(str(error)))
            page.route("**/*", serve)
            page.goto(f"{_ORIGIN}/")
            page.wait_for_function("() => window.ready === true")
            yield ViewPage(page, files, said)
        finally:
            browser.close()
