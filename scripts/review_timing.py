"""How quick the review page is: opening objects of a queue of 1,000, and a scripted correction.

    python scripts/review_timing.py [--items 1000] [--opened 20] [--corrected 15] [--side 1000]

Photos of made-up cars and their annotations go into a temporary folder; headless Chromium shows the page and
draws with the CPU; `make browser` sets it up.
"""

from __future__ import annotations

import argparse
import json
import re
import statistics
import sys
import tempfile
import time
from pathlib import Path

# The made-up photos and the browser's driver are those of the tests.
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from tests.review.browser.browsing import Desk, browsing, missing, reviewing
from tests.review.browser.making import TURNED, make_store
from tests.small_library import write_models

EACH = 8


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--items", type=int, default=1000)
    parser.add_argument("--opened", type=int, default=20)
    parser.add_argument("--corrected", type=int, default=15)
    parser.add_argument("--side", type=int, default=1000, help="longer side of the photos, pixels")
    options = parser.parse_args()
    if missing():
        raise SystemExit(missing())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        library = Library.create(folder / "library")
        add_path(library, write_models(folder / "models"))
        size = (options.side, options.side * 3 // 4)
        store = make_store(folder, library, photos=-(-options.items // EACH), each=EACH, size=size)
        words = ("--photos", folder / "photos", "--library", library.path, "--author", "timing")
        with reviewing(store, *words) as address, browsing() as browser:
            desk = browser.open(address)
            began = time.perf_counter()
            desk.drawn()
            told = {"first item, s": round(time.perf_counter() - began, 2)}
            told |= corrections(desk, options.corrected)
            told |= openings(desk, options.opened)
    print(json.dumps(told, indent=2))


def openings(desk: Desk, count: int) -> dict[str, float]:
    """A person looks at each for a second and goes on; milliseconds from the key to the picture."""
    desk.page.evaluate("performance.clearMeasures()")
    for _ in range(count):
        before = desk.item()
        desk.page.wait_for_timeout(1000)
        desk.press("j")
        desk.drawn(before)
    times = desk.opening_times()
    return {
        "opening, median ms": round(statistics.median(times)),
        "opening, slowest ms": round(max(times)),
        "opened within 200 ms": sum(each < 200.0 for each in times),
        "opened": len(times),
    }


def corrections(desk: Desk, count: int) -> dict[str, float]:
    """Open, turn back by 40°, snap, accept: without the second in which a person would look."""
    totals: list[float] = []
    snaps: list[float] = []
    before_iou: list[float] = []
    after_iou: list[float] = []
    for _ in range(count):
        began = time.perf_counter()
        item = desk.drawn()
        before_iou.append(desk.iou())
        azimuth = desk.number("azimuth")
        desk.press(*["Shift+ArrowLeft"] * round(TURNED / 10))
        desk.becomes("azimuth", azimuth - TURNED)
        asked = time.perf_counter()
        desk.press("s")
        told = desk.notice("Snapped in")
        snaps.append(time.perf_counter() - asked)
        # The number beside the sliders follows only after the picture is drawn.
        found = re.search(r"Mask IoU .*?([01]\.\d\d)\.", told)
        if found is not None:
            after_iou.append(float(found[1]))
        desk.press("a")
        desk.page.wait_for_function("id => location.hash.slice(2) !== id", arg=item)
        totals.append(time.perf_counter() - began)
    return {
        "correction, median s": round(statistics.median(totals), 2),
        "correction, slowest s": round(max(totals), 2),
        "of it snap, median s": round(statistics.median(snaps), 2),
        "mask IoU before, median": round(statistics.median(before_iou), 3),
        "mask IoU after, median": round(statistics.median(after_iou), 3),
        "corrected": count,
    }


if __name__ == "__main__":
    main()
