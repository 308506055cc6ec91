"""Many reviewers at once on one store: every decision that was taken is there exactly once, none is lost.

    python scripts/review_load.py OUT.json --clients 50 --requests 5000 --items 1000

Starts `cadpose review` on a store of made-up annotations, lets clients read the queue, open annotations and
decide, some of them on purpose on a version that is no longer there, and then looks into the store: an answer
of 200 is one decision of that client, an answer of 409 is none. Times are those the clients saw.
"""

from __future__ import annotations

import argparse
import hashlib
import http.client
import json
import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.store import Selection, Store
from cadpose.geometry.boxes import Box
from cadpose.records import (
    Annotation,
    CadModel,
    Candidate,
    Detection,
    Photo,
    Pose4Dof,
    Rotation,
    RotationHypothesis,
)

#: What clients do, and how often.
MIX = {"queue": 35, "open": 30, "decide": 25, "stale": 7, "stats": 3}
WIDTH, HEIGHT = 640, 480


@dataclass
class Seen:
    """What one client saw.

    Attributes:
        times: Seconds by kind of request.
        taken: (annotation, version told, note) of decisions that were taken.
        refused: (annotation, note) of those that were refused.
        wrong: Answers that should not be.
    """

    times: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    taken: list[tuple[str, int, str]] = field(default_factory=list)
    refused: list[tuple[str, str]] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)


class Client(threading.Thread):
    """One reviewer with one connection."""

    def __init__(self, number: int, url: str, requests: int, ids: list[str], every: int) -> None:
        super().__init__(daemon=True)
        base, _, token = url.partition("/?token=")
        self.host = base.removeprefix("http://")
        self.heads = {"content-type": "application/json"}
        if number % 2:
            self.heads["authorization"] = f"Bearer {token}"
        else:  # as a browser does
            self.heads |= {"cookie": cookie_of(self.host, token), "origin": base}
        self.number, self.requests, self.ids, self.every = number, requests, ids, every
        self.random, self.seen, self.count = random.Random(number), Seen(), 0
        self.connection = http.client.HTTPConnection(self.host, timeout=120)

    def run(self) -> None:
        try:
            kinds, weights = list(MIX), list(MIX.values())
            while self.count < self.requests:
                getattr(self, f"do_{self.random.choices(kinds, weights)[0]}")()
        except Exception as error:
            self.seen.wrong.append(f"client {self.number}: {type(error).__name__}: {error}")
        finally:
            self.connection.close()

    def ask(self, kind: str, path: str, body: Any = None) -> tuple[int, Any]:
        self.count += 1
        start = time.perf_counter()
        data = None if body is None else json.dumps(body)
        self.connection.request("GET" if body is None else "POST", path, data, self.heads)
        answer = self.connection.getresponse()
        text = answer.read()
        self.seen.times[kind].append(time.perf_counter() - start)
        if answer.status not in (200, 409) or (answer.status == 409 and body is None):
            self.seen.wrong.append(f"{path}: {answer.status} {text[:200]!r}")
        return answer.status, json.loads(text)

    def do_queue(self) -> None:
        query = self.random.choice(("", "&verdict=undecided", "&category=car", "&text=photo-1"))
        _, page = self.ask("queue", f"/api/queue?limit=50{query}")
        if page.get("after") and self.random.random() < 0.5:
            self.ask("queue", f"/api/queue?limit=50{query}&after={page['after']}")

    def do_open(self) -> Any:
        # A few annotations are everybody's: there people meet.
        crowd = self.ids[: max(4, self.every // 100)]
        key = self.random.choice(crowd if self.random.random() < 0.3 else self.ids)
        _, told = self.ask("open", f"/api/annotations/{key}")
        if told.get("id") != key:
            self.seen.wrong.append(f"{key[:8]}: another annotation came")
        return told

    def do_decide(self, behind: int = 0) -> None:
        told = self.do_open()
        note = f"client {self.number}, request {self.count}"
        body: dict[str, Any] = {
            "verdict": self.random.choice(("accept", "reject", "edit", "skip", "review")),
            "version": told["version"] - behind,
            "author": f"client {self.number}",
            "note": note,
        }
        if body["verdict"] == "edit":
            body["pose"] = told["pose"] | {"azimuth": self.random.uniform(0.0, 359.0)}
        status, answer = self.ask("decide", f"/api/annotations/{told['id']}/decisions", body)
        if status == 200:
            self.seen.taken.append((told["id"], answer["version"], note))
            if behind:
                self.seen.wrong.append(f"{told['id'][:8]}: a stale version was taken")
        elif status == 409:
            self.seen.refused.append((told["id"], note))
            if answer["current"]["version"] == body["version"]:
                self.seen.wrong.append(f"{told['id'][:8]}: refused although nothing had changed")

    def do_stale(self) -> None:
        self.do_decide(behind=1)

    def do_stats(self) -> None:
        self.ask("stats", self.random.choice(("/api/stats", "/api/session")))


def cookie_of(host: str, token: str) -> str:
    """What the server gives a browser for the token."""
    connection = http.client.HTTPConnection(host, timeout=120)
    try:
        connection.request("GET", f"/?token={token}")
        return str(connection.getresponse().headers["set-cookie"]).partition(";")[0]
    finally:
        connection.close()


def made_document(number: int) -> AnnotationDocument:
    """One photo with one annotation, without a picture: this is about the store."""
    rng = np.random.default_rng(number)
    sha256 = hashlib.sha256(f"photo {number}".encode()).hexdigest()
    photo = Photo(np.zeros((HEIGHT, WIDTH, 3), np.uint8), f"photos/photo-{number:05d}.jpg", sha256)
    x, y = rng.uniform(20, 300), rng.uniform(20, 200)
    box = Box(x, y, x + rng.uniform(60, 300), y + rng.uniform(60, 250))
    rows, columns = np.mgrid[:HEIGHT, :WIDTH] + 0.5
    cx, cy = box.centre
    mask = ((columns - cx) / box.width * 2) ** 2 + ((rows - cy) / box.height * 2) ** 2 < 1.0
    rotation = Rotation(rng.uniform(0, 360), rng.uniform(-10, 40), rng.uniform(-5, 5))
    category = ("car", "chair", "cup")[number % 3]
    cads = [CadModel(f"made/{category}-{i}.obj", f"{category} {i}", category) for i in range(10)]
    return document_from(
        photo,
        [
            Annotation(
                photo_name=photo.name,
                photo_sha256=sha256,
                photo_size=(WIDTH, HEIGHT),
                detection=Detection(box, category, float(rng.uniform(0.3, 1.0)), np.asarray(mask)),
                pose=Pose4Dof(rotation, 2.0 * box.width, box.centre),
                candidates=tuple(Candidate(cad, 1.0 - i / 20, rotation) for i, cad in enumerate(cads)),
                hypotheses=tuple(RotationHypothesis(rotation, 1.0 - i / 9, 0.3) for i in range(3)),
                box_iou=0.9,
                mask_iou=0.8,
                confidence=float(rng.uniform()),
                verdict="review",
            )
        ],
    )


def check(store: Store, ids: list[str], seen: list[Seen]) -> list[str]:
    """What the store holds against what the clients were told."""
    faults = []
    taken = {note: (key, version) for one in seen for key, version, note in one.taken}
    refused = {note for one in seen for _, note in one.refused}
    versions: dict[str, list[int]] = defaultdict(list)
    for key, version in taken.values():
        versions[key].append(version)
    held: Counter[str] = Counter()
    for key in ids:
        people = [d for d in store.history(key) if d.author.kind == "human"]
        for decision in people:
            held[decision.note] += 1
            if taken.get(decision.note, ("", 0))[0] != key:
                faults.append(f"{key[:8]}: the store holds a decision that nobody was told of")
        if sorted(versions[key]) != list(range(2, 2 + len(people))):
            faults.append(f"{key[:8]}: {len(people)} decisions, versions told {sorted(versions[key])}")
        stored = store.stored(key)
        if stored is None or stored.item.version != 1 + len(people):
            faults.append(f"{key[:8]}: its version does not count its decisions")
    faults += [f"lost: {note}" for note in taken if held[note] == 0]
    faults += [f"there twice: {note}" for note, count in held.items() if count > 1]
    faults += [f"refused, and there all the same: {note}" for note in refused if held[note]]
    return faults + [str(problem) for problem in store.check()]


def run(clients: int, requests: int, items: int, folder: Path) -> dict[str, Any]:
    """The whole test; what came of it."""
    url = f"sqlite:///{folder / 'load.db'}"
    with Store(url) as store:
        store.add_many(made_document(number) for number in range(items))
        ids = [found.item.annotation_id for found in store.iter_stored(Selection())]
    command = [sys.executable, "-c", "from cadpose.cli.main import main; main()"]
    command += ["review", "--store", url, "--no-open", "--json"]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert server.stdout is not None
        line = server.stdout.readline()
        if not line:
            raise SystemExit(server.communicate()[1])
        address = json.loads(line)["url"]
        workers = [Client(n, address, requests // clients, ids, items) for n in range(clients)]
        start = time.perf_counter()
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        seconds = time.perf_counter() - start
    finally:
        server.send_signal(signal.SIGINT)
        _, errors = server.communicate(timeout=60)
    seen = [worker.seen for worker in workers]
    with Store(url) as store:
        faults = check(store, ids, seen)
    logged = [line for line in errors.splitlines() if "stopped" not in line and "CAD library" not in line]
    times = {
        kind: [t for one in seen for t in one.times[kind]] for kind in ("queue", "open", "decide", "stats")
    }
    return {
        "clients": clients,
        "requests": sum(len(of_kind) for of_kind in times.values()),
        "items": items,
        "seconds": round(seconds, 2),
        "requests_a_second": round(sum(len(of_kind) for of_kind in times.values()) / seconds, 1),
        "decisions_taken": sum(len(one.taken) for one in seen),
        "decisions_refused": sum(len(one.refused) for one in seen),
        "milliseconds": {
            kind: {f"p{q}": round(1000 * float(np.percentile(of_kind, q)), 1) for q in (50, 95, 99)}
            for kind, of_kind in times.items()
            if of_kind
        },
        "errors": [wrong for one in seen for wrong in one.wrong] + logged,
        "faults_in_the_store": faults,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--clients", type=int, default=50)
    parser.add_argument("--requests", type=int, default=5000)
    parser.add_argument("--items", type=int, default=1000)
    told = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = run(told.clients, told.requests, told.items, Path(folder))
    told.out.write_text(json.dumps(result, indent=2) + "\n")
    print(json.dumps(result, indent=2))
    if result["errors"] or result["faults_in_the_store"]:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
