"""The page in a real browser: a `cadpose review` process, headless Chromium, words for what a person does."""

from __future__ import annotations

import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from tests.annotations.scenes.viewer import FLAGS, PACKAGES, chromium

# Without a graphics card the photo is drawn by WebGL on the CPU; painting the rest of the page so is slow.
_FLAGS = [*FLAGS, "--disable-gpu-rasterization"]
_REVIEW = "from cadpose.cli.main import main; main()"
AXE = PACKAGES / "axe-core" / "axe.min.js"
STATIC = Path(__file__).parents[3] / "src" / "cadpose" / "review" / "static"
# Opening the library, making an annotator and drawing by the CPU take a while on a loaded machine.
PATIENCE_MS = 120_000


def missing() -> str:
    """What is not there, as one sentence; empty when all is."""
    if chromium() is None:
        return "needs Chromium: run `make browser`"
    try:
        import playwright.sync_api  # noqa: F401
    except ImportError:
        return "needs playwright: run `make browser`"
    if not AXE.is_file():
        return "needs axe-core: run `make browser`"
    if not (STATIC / "app.js").is_file():
        return "needs the built page: run `make web`"
    return ""


@contextmanager
def reviewing(store: str, *options: str | Path) -> Iterator[str]:
    """A `cadpose review` process; gives the address with its token."""
    words = [sys.executable, "-c", _REVIEW, "review", "--store", store, "--no-open", *map(str, options)]
    environment = os.environ | {"OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        said: list[str] = []
        # Read all along: a full pipe would stop the server.
        errors = threading.Thread(target=lambda: said.extend(process.stderr or ()), daemon=True)
        errors.start()
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            if not address.startswith("http"):
                process.kill()
                errors.join(5.0)
                raise AssertionError(f"cadpose review did not start: {address} {''.join(said)}")
            yield address
        finally:
            process.terminate()
            try:
                process.wait(20.0)
            except subprocess.TimeoutExpired:
                process.kill()


@dataclass(eq=False)
class Browser:
    """Chromium; every fault of a page is kept."""

    _browser: Any
    faults: list[str] = field(default_factory=list)

    def open(
        self,
        address: str,
        *,
        size: tuple[int, int] = (1440, 900),
        scheme: str = "light",
        expected: tuple[str, ...] = (),
    ) -> Desk:
        """A person's own window: nothing is shared with others.

        Args:
            address: Where.
            size: Of the window, pixels.
            scheme: ``light`` or ``dark``.
            expected: Parts of messages of the console that are no fault.
        """
        context = self._browser.new_context(
            viewport={"width": size[0], "height": size[1]}, color_scheme=scheme, accept_downloads=True
        )
        page = context.new_page()
        page.set_default_timeout(PATIENCE_MS)

        def heard(message: Any) -> None:
            if message.type == "error" and not any(part in message.text for part in expected):
                self.faults.append(message.text)

        page.on("console", heard)
        page.on("pageerror", lambda error: self.faults.append(str(error)))
        page.goto(address)
        return Desk(page)


@contextmanager
def browsing() -> Iterator[Browser]:
    """Start Chromium; at the end no page may have had a fault."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=chromium(), args=_FLAGS)
        browser = Browser(started)
        try:
            yield browser
            assert not browser.faults, browser.faults
        finally:
            started.close()


@dataclass(frozen=True, eq=False)
class Desk:
    """One person's page."""

    page: Any

    def press(self, *keys: str) -> None:
        for key in keys:
            self.page.keyboard.press(key)

    def item(self) -> str:
        """Key of the open annotation."""
        return str(self.page.evaluate("location.hash.slice(2)"))

    def drawn(self, other_than: str = "") -> str:
        """Wait until the open annotation, or the next one, stands on the screen; its key."""
        self.page.wait_for_function(
            """before => {
              const id = location.hash.slice(2);
              return id && id !== before && document.querySelector('.stage')?.dataset.drawn === id;
            }""",
            arg=other_than,
        )
        return self.item()

    def button(self, name: str, within: str = "body") -> Any:
        return self.page.locator(within).get_by_role("button", name=name, exact=True)

    def number(self, field_name: str) -> float:
        """One of the pose's numbers, as its field shows it."""
        return float(self.page.input_value(f"[data-field={field_name}]"))

    def becomes(self, field_name: str, value: float) -> None:
        """Wait until a field shows a value; angles may go once around."""
        self.page.wait_for_function(
            """([name, value]) => {
              const off = Math.abs(document.querySelector(`[data-field=${name}]`).valueAsNumber - value);
              return Math.min(off, Math.abs(360 - off)) < 0.11;
            }""",
            arg=[field_name, value],
        )

    def iou(self) -> float:
        """IoU of silhouette and mask, as the page shows it."""
        self.page.wait_for_function("() => document.querySelector('output').dataset.iou !== ''")
        return float(self.page.get_attribute("output", "data-iou"))

    def notice(self, part: str) -> str:
        """Wait for what the page says."""
        found = self.page.locator(".notice", has_text=part)
        found.wait_for()
        return str(found.inner_text())

    def dialog(self, title: str) -> Any:
        """Wait for a dialogue."""
        found = self.page.get_by_role("dialog", name=title)
        found.wait_for()
        return found

    def no_dialog(self) -> None:
        self.page.wait_for_function("() => !document.querySelector('dialog')")

    def violations(self) -> list[str]:
        """What axe finds on the screen as it is, one line each."""
        # By the debugger's way: the page itself may run no foreign script.
        self.page.evaluate(AXE.read_text("utf-8") + ";0")
        found = self.page.evaluate("axe.run(document, {resultTypes: ['violations']})")
        return [
            f"{each['id']}: {each['help']}: {', '.join(node['html'][:120] for node in each['nodes'][:3])}"
            for each in found["violations"]
        ]

    def opening_times(self) -> list[float]:
        """Milliseconds from asking for each item until it was drawn."""
        found = self.page.evaluate(
            "performance.getEntriesByName('cadpose-open', 'measure').map(e => e.duration)"
        )
        return [float(each) for each in found]

    def close(self) -> None:
        self.page.context.close()
