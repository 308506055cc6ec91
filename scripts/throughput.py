"""How many photos a second with one worker, with two, and over two Ray nodes; and what memory they take.

    python scripts/throughput.py OUT --photos 200
    python scripts/throughput.py OUT --photos 2000 --only 2    # memory over many photos

Each way annotates the same photos into a folder of its own, one after the other, so that the ratios are of
one run on one machine. Resident memory of parent and workers is read from /proc every second; the slope is
that of the straight line through the second half of the readings. See docs/many-photos.md.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
from many_photos import OPTIONS, bench_photos, make_photos

PROGRAM = [sys.executable, "-c", "from cadpose.cli.main import main; main()"]
#: The same program with a local Ray cluster of two nodes, one CPU each, around it.
RAY_PROGRAM = [
    sys.executable,
    "-c",
    "import os; os.environ['RAY_USAGE_STATS_ENABLED'] = '0'\n"
    "from ray.cluster_utils import Cluster; import ray, sys\n"
    "cluster = Cluster(True, head_node_args={'num_cpus': 1, 'include_dashboard': False})\n"
    "cluster.add_node(num_cpus=1)\n"
    "ray.init(address=cluster.address, log_to_driver=False, logging_level='ERROR')\n"
    "from cadpose.cli.main import main\n"
    # Left to the interpreter's end, the nodes go before the program has let go of them, which makes it fail.
    "try: main()\n"
    "finally: ray.shutdown(); cluster.shutdown()",
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--photos", type=int, default=200)
    parser.add_argument("--from", dest="sources", type=Path, help="folder of photos; the benchmark's cars")
    parser.add_argument("--library", type=Path)
    parser.add_argument("--only", action="append", choices=["1", "2", "ray"], help="of 1, 2 and ray")
    parser.add_argument("--option", action="append", default=[], help="one more word for `annotate`")
    options = parser.parse_args()
    sources = bench_photos() if options.sources is None else sorted(options.sources.iterdir())
    photos = options.out / "photos"
    make_photos(sources, photos, options.photos)
    told: dict[str, dict[str, object]] = {}
    for way in options.only or ["1", "2", "ray"]:
        out = options.out / f"by-{way}"
        shutil.rmtree(out, ignore_errors=True)
        words = ["annotate", str(photos), "--out", str(out), *OPTIONS, *options.option]
        words += ["--workers", "2" if way == "ray" else way]
        words += ["--executor", "ray"] if way == "ray" else []
        words += ["--library", str(options.library)] if options.library else []
        told[way] = measure([*(RAY_PROGRAM if way == "ray" else PROGRAM), *words], out, options.photos)
        print(f"{way}: {json.dumps(told[way])}", file=sys.stderr)
    if "1" in told:
        base = float(str(told["1"]["photos_per_second"]))
        for one in told.values():
            one["ratio"] = round(float(str(one["photos_per_second"])) / base, 3)
    print(json.dumps(told))


def measure(command: list[str], out: Path, photos: int) -> dict[str, object]:
    """Photos a second from the first finished photo to the last, and memory."""
    log = out.with_suffix(".log")
    with log.open("wb") as stream:
        process = subprocess.Popen(command, stdout=stream, stderr=stream, start_new_session=True)
        memory = Memory(process.pid)
        memory.start()
        start = time.monotonic()
        code = process.wait()
        seconds = time.monotonic() - start
        memory.stop()
    if code:
        sys.exit(f"it failed, see {log}")
    times = sorted(path.stat().st_mtime for path in out.glob("*.json"))
    if len(times) != photos:
        sys.exit(f"{len(times)} documents of {photos}, see {log}")
    return {
        "photos_per_second": round((photos - 1) / max(times[-1] - times[0], 1e-9), 3),
        "seconds_in_all": round(seconds, 1),
        "memory": memory.told(photos, times[-1] - times[0]),
    }


class Memory(threading.Thread):
    """Reads the resident memory of a process and of its children every second."""

    def __init__(self, pid: int) -> None:
        super().__init__(daemon=True)
        self.pid, self.rows = pid, list[tuple[float, float, list[float]]]()
        self._end = threading.Event()

    def run(self) -> None:
        while not self._end.wait(1.0):
            children = [resident(pid) for pid in descendants(self.pid)]
            self.rows.append((time.monotonic(), resident(self.pid), children))

    def stop(self) -> None:
        self._end.set()
        self.join()

    def told(self, photos: int, seconds: float) -> dict[str, object]:
        """Highest MB of parent and of the largest child, and kB that they grow by a photo."""
        half = self.rows[len(self.rows) // 2 :]
        if len(half) < 3:
            return {}
        times = np.array([row[0] for row in half])
        parent = np.array([row[1] for row in half])
        child = np.array([max(row[2], default=0.0) for row in half])
        rate = photos / max(seconds, 1e-9)
        return {
            "parent_mb": round(max(row[1] for row in self.rows), 1),
            "worker_mb": round(max(max(row[2], default=0.0) for row in self.rows), 1),
            "parent_kb_per_photo": round(1024 * np.polyfit(times, parent, 1)[0] / rate, 2),
            "worker_kb_per_photo": round(1024 * np.polyfit(times, child, 1)[0] / rate, 2),
        }


def resident(pid: int) -> float:
    """MB; 0 where the process has gone."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def descendants(pid: int) -> list[int]:
    """Children, and their children."""
    try:
        own = [int(word) for word in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    except OSError:
        return []
    return own + [grandchild for child in own for grandchild in descendants(child)]


if __name__ == "__main__":
    main()
