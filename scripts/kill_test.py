"""Kill runs of `cadpose annotate` at random moments, resume them, and look whether anything was lost.

    python scripts/kill_test.py OUT --photos 2000 --kills 20
    python scripts/kill_test.py OUT --photos 2000 --kills 20 --writers 2

The whole process group gets SIGKILL, as in a power cut of the program. Afterwards every photo has one whole
document, the store has each photo once, and no document that was finished before a kill was written again.
See docs/many-photos.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

from many_photos import OPTIONS, bench_photos, make_photos

PROGRAM = [sys.executable, "-c", "from cadpose.cli.main import main; main()"]


@dataclass
class Writer:
    """One `cadpose annotate` on its own photos."""

    photos: list[Path]
    folder: Path
    out: Path
    command: list[str]
    process: subprocess.Popen[bytes] | None = None
    done: dict[str, tuple[int, int]] = field(default_factory=dict)
    again: int = 0

    def start(self) -> None:
        with (self.out.parent / f"{self.out.name}.log").open("ab") as log:
            self.process = subprocess.Popen(self.command, stdout=log, stderr=log, start_new_session=True)

    def kill(self) -> None:
        assert self.process is not None
        os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()

    def finished(self) -> int:
        return sum(path.name.count(".") == 1 for path in self.out.glob("*.json"))

    def look(self) -> None:
        """Count finished documents that have been written again since the last look."""
        for path in self.out.glob("*.json"):
            status = path.stat()
            mark = status.st_mtime_ns, status.st_size
            self.again += self.done.setdefault(path.name, mark) != mark


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, help="folder of everything; made anew")
    parser.add_argument("--photos", type=int, default=2000)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--writers", type=int, default=1, help="processes that share one store")
    parser.add_argument("--from", dest="sources", type=Path, help="folder of photos; the benchmark's cars")
    parser.add_argument("--library", type=Path)
    parser.add_argument("--store", help="URL; an SQLite file in OUT unless told")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--option", action="append", default=[], help="one more word for `annotate`")
    options = parser.parse_args()
    if options.out.exists():
        shutil.rmtree(options.out)
    sources = bench_photos() if options.sources is None else sorted(options.sources.iterdir())
    url = options.store or f"sqlite:///{options.out / 'store.db'}"
    writers = []
    for number in range(options.writers):
        folder = options.out / f"photos-{number}"
        share = options.photos // options.writers + (number < options.photos % options.writers)
        photos = make_photos(sources, folder, share, seed=number)
        out = options.out / f"annotations-{number}"
        command = [*PROGRAM, "annotate", str(folder), "--out", str(out), "--store", url, "--resume"]
        command += ["--workers", str(options.workers), *OPTIONS, *options.option]
        command += ["--library", str(options.library)] if options.library else []
        writers.append(Writer(photos, folder, out, command))
    start = time.monotonic()
    kills = kill_often(writers, options.photos, options.kills, random.Random(options.seed))
    for writer in writers:
        writer.start()
    for writer in writers:
        assert writer.process is not None
        if writer.process.wait() != 0:
            sys.exit(f"the last run failed, see {writer.out}.log")
        writer.look()
    problems = look_at(writers, url)
    print(
        json.dumps(
            {
                "photos": options.photos,
                "kills": kills,
                "documents": sum(writer.finished() for writer in writers),
                "written_again": sum(writer.again for writer in writers),
                "seconds": round(time.monotonic() - start, 1),
                "problems": problems,
            }
        )
    )
    sys.exit(1 if problems else 0)


def kill_often(writers: list[Writer], photos: int, kills: int, chance: random.Random) -> list[int]:
    """Start and kill; how many photos were finished at each kill."""
    told = []
    for number in range(kills):
        for writer in writers:
            writer.start()
        before = sum(writer.finished() for writer in writers)
        # Spread over the work that is left; now and then while models are still being loaded.
        share = (photos - before) / (kills - number + 1)
        more = 0 if chance.random() < 0.15 else chance.randint(1, max(1, int(1.2 * share)))
        while sum(writer.finished() for writer in writers) < before + more:
            if all(writer.process is not None and writer.process.poll() is not None for writer in writers):
                break
            time.sleep(0.02)
        time.sleep(chance.uniform(0.0, 4.0 if more == 0 else 0.5))
        for writer in writers:
            writer.kill()
        for writer in writers:
            writer.look()
        told.append(sum(writer.finished() for writer in writers))
        print(f"kill {number + 1}: {told[-1]} of {photos} finished", file=sys.stderr)
    return told


def look_at(writers: list[Writer], url: str) -> list[str]:
    """What is wrong in the end; empty when all is well."""
    problems = []
    wanted: dict[str, str] = {}
    for writer in writers:
        if writer.again:
            problems.append(f"{writer.again} finished documents of {writer.out} were written again")
        for photo in writer.photos:
            digest = hashlib.sha256(photo.read_bytes()).hexdigest()
            wanted[digest] = str(photo)
            path = writer.out / f"{photo.stem}.json"
            try:
                document = json.loads(path.read_text(encoding="utf-8"))
            except (OSError, ValueError) as error:
                problems.append(f"{path}: {error}")
                continue
            if document["photo"]["sha256"] != digest or len(document["annotations"]) != 1:
                problems.append(f"{path}: not the document of {photo}")
        problems += [f"{path} was left" for path in writer.out.glob("*.failed.json")]
    problems += look_at_store(url, wanted)
    check = subprocess.run(
        [*PROGRAM, "db", "check", "--store", url], capture_output=True, text=True, check=False
    )
    if check.returncode:
        problems.append(f"cadpose db check: {check.stdout}{check.stderr}")
    return problems


def look_at_store(url: str, wanted: dict[str, str]) -> list[str]:
    from cadpose.annotations.store import Store

    problems = []
    with Store(url) as store:
        held = [photo.sha256 for photo in store.photos()]
        annotations = sum(1 for _ in store.iter_annotations())
    if sorted(held) != sorted(wanted):
        problems.append(f"the store holds {len(held)} photos, {len(set(held))} of them different")
    if annotations != len(wanted):
        problems.append(f"the store holds {annotations} annotations")
    if url.startswith("sqlite:///"):
        with sqlite3.connect(url.removeprefix("sqlite:///")) as database:
            told = database.execute("PRAGMA integrity_check").fetchall()
        if told != [("ok",)]:
            problems.append(f"PRAGMA integrity_check: {told}")
    return problems


if __name__ == "__main__":
    main()
