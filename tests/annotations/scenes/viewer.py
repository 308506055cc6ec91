"""A real viewer for the tests: three.js in headless Chromium. `make browser` sets both up.

    python -m tests.annotations.scenes.viewer SCENE.glb PICTURE.png [WIDTH] [TURN]

draws a scene with its backdrop as the camera in it sees it, TURN degrees aside.
"""

from __future__ import annotations

import base64
import io
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

#: Where `make browser` unpacks packages of npm.
PACKAGES = Path(sys.prefix) / "browser"
_PAGE = Path(__file__).with_name("viewer.html")
_ORIGIN = "http://scene.invalid"
_TYPES = {".html": "text/html", ".js": "text/javascript", ".glb": "model/gltf-binary"}
# WebGL on the CPU; Chromium's sandbox needs what containers lack.
FLAGS = ["--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]


def missing() -> str:
    """What is not there, as one sentence; empty when all is."""
    if chromium() is None:
        return "needs Chromium: run `make browser`"
    if not (PACKAGES / "three" / "package.json").is_file():
        return "needs three.js: run `make browser`"
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "needs playwright: run `make browser`"
    return ""


def chromium() -> str | None:
    """The program."""
    return next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)


@dataclass(frozen=True, eq=False)
class Viewer:
    """A page with three.js in it."""

    page: Any

    def load(self, scene: Path) -> dict[str, Any]:
        """Open a .glb; what the page tells of it."""
        place = f"/scenes/{scene.resolve().as_posix()}"
        told: dict[str, Any] = self.page.evaluate("place => window.loadScene(place)", place)
        return told

    def show(
        self, width: int, height: int, mode: str, only: int | None = None, turn: float = 0.0
    ) -> NDArray[np.uint8]:
        """(H, W, 4) uint8 of what was loaded, by the camera in it; see the page for the modes."""
        url = self.page.evaluate("told => window.show(...told)", [width, height, mode, only, turn])
        return np.array(Image.open(io.BytesIO(base64.b64decode(url.partition(",")[2]))).convert("RGBA"))


@contextmanager
def viewer() -> Iterator[Viewer]:
    """Start Chromium with the page; nothing outside this machine is asked for anything."""
    from playwright.sync_api import Route, sync_playwright

    faults: list[str] = []

    def serve(route: Route) -> None:
        path = route.request.url.removeprefix(_ORIGIN)
        places = {"/three/": PACKAGES / "three", "/scenes/": Path("/")}
        file = _PAGE
        for start, folder in places.items():
            if path.startswith(start):
                file = folder / path.removeprefix(start).lstrip("/")
        if path == "/favicon.ico" or not route.request.url.startswith(_ORIGIN) or not file.is_file():
            route.fulfill(status=404)
        else:
            route.fulfill(body=file.read_bytes(), content_type=_TYPES[file.suffix])

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        try:
            page = browser.new_page()
            page.on("pageerror", lambda error: faults.append(str(error)))
            page.route("**/*", serve)
            page.goto(f"{_ORIGIN}/")
            page.wait_for_function("window.ready === true")
            yield Viewer(page)
            assert not faults, faults
        finally:
            browser.close()


def main(scene: str, picture: str, width: str = "960", turn: str = "0") -> None:
    with viewer() as shown:
        shown.load(Path(scene))
        size = shown.page.evaluate("window.scene.cameras[0].aspect")
        pixels = shown.show(int(width), round(int(width) / size), "whole", turn=float(turn))
        Image.fromarray(pixels[..., :3].copy()).save(picture)


if __name__ == "__main__":
    main(*sys.argv[1:])
