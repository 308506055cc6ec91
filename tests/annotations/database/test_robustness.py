"""Kills, two writers, full disks, read-only places: one clear sentence, and no damage."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from cadpose.annotations.store import Author, Store
from cadpose.errors import CadposeError
from tests.annotations.factory import make_document

ROOT = Path(__file__).parents[3]
ENVIRONMENT = os.environ | {"PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT}"}

posix = pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL and users")

# Adds photos, annotates some of them otherwise and decides; tells what is committed.
WRITER = """
import sys
from cadpose.annotations.store import Author, Store
from tests.annotations.factory import make_document

url, name, rounds, pause = sys.argv[1], sys.argv[2], int(sys.argv[3]), sys.argv[4] == "pause"
author = Author(name)
with Store(url) as store:
    print("open", flush=True)
    if pause:
        sys.stdin.readline()
    for i in range(rounds):
        for photo, annotations in ((f"{name} {i}.jpg", 2), (f"shared {i}.jpg", 1), (f"{name} {i}.jpg", 1)):
            document = make_document(photo, annotations)
            store.add(document)
            print(photo, flush=True)
        found = store.document(document.photo.sha256)
        for item in store.queue(limit=1000).items:
            if item.photo_name == f"{name} {i}.jpg":
                store.decide(item.annotation_id, "accept", author, expected_version=item.version)
                print("decided", item.annotation_id, flush=True)
        store.add_failure(f"broken {i}.jpg", None, "reading", "is no photo")
"""


def writer(url: str, name: str, rounds: int, pause: bool = False) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", WRITER, url, name, str(rounds), "pause" if pause else "go"],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=ENVIRONMENT,
    )  # fmt: skip


def kill_again_and_again(url: str, kills: int, seed: int) -> None:
    """Start a writer, kill it at a random moment, look; what it told to be committed is there."""
    rng, told = random.Random(seed), set[str]()
    for number in range(kills):
        process = writer(url, "w", 50)
        assert process.stdout is not None
        timer = threading.Timer(120.0, process.kill)
        timer.start()
        for _ in range(rng.randint(1, 12)):
            told.add(process.stdout.readline().strip())
        # Somewhere in what comes next.
        threading.Event().wait(rng.random() * 0.05)
        process.send_signal(signal.SIGKILL)
        told |= {line.strip() for line in process.stdout if line.endswith("\n")}
        assert process.wait() == -signal.SIGKILL
        timer.cancel()
        with Store(url) as store:
            assert list(store.check()) == [], f"after kill {number}"
            names = {photo.name for photo in store.photos()}
            photos = {line for line in told if line.endswith(".jpg")}
            assert photos <= names
            for line in told:
                if line.startswith("decided "):
                    assert any(d.author.name == "w" for d in store.history(line.split()[1]))
    with Store(url) as store:
        assert len({photo.name for photo in store.photos()}) == len(store.photos()) > 0


@posix
def test_a_writer_that_is_killed_at_random_leaves_a_sound_store(url: str) -> None:
    kill_again_and_again(url, kills=2, seed=1)


@posix
@pytest.mark.slow
def test_a_writer_that_is_killed_twenty_times_leaves_a_sound_store(url: str) -> None:
    kill_again_and_again(url, kills=20, seed=2)


KILLED = """
import os, signal, sys
import sqlalchemy as sa
from cadpose.annotations.store import Store
from tests.annotations.factory import make_document

url, start = sys.argv[1], sys.argv[2]
store = Store(url)
writing = 0

@sa.event.listens_for(sa.Engine, "after_cursor_execute")
def die(connection, cursor, statement, *rest):
    if writing == 1 and statement.startswith(start):
        os.kill(os.getpid(), signal.SIGKILL)

for writing in range(5):
    store.add(make_document(f"{writing}.jpg", annotations=3))
"""


@posix
@pytest.mark.parametrize("statement", ["UPDATE photos", "INSERT INTO candidates ", "DELETE FROM failures"])
def test_a_killed_writer_leaves_only_whole_photos(url: str, statement: str) -> None:
    # Photo 1 is there before, with another answer: its replacement dies half-way.
    old = make_document("1.jpg", annotations=1)
    with Store(url) as store:
        store.add(old)
    command = [sys.executable, "-c", KILLED, url, statement]
    killed = subprocess.run(command, cwd=ROOT, env=ENVIRONMENT, check=False)
    assert killed.returncode == -signal.SIGKILL
    with Store(url) as store:
        assert list(store.check()) == []
        assert [photo.name for photo in store.photos()] == ["0.jpg", "1.jpg"]
        whole = make_document("0.jpg", annotations=3)
        assert store.document(whole.photo.sha256) == whole
        assert store.document(old.photo.sha256) == old and store.former(old.photo.sha256) == []


def test_two_writers_at_once_lose_nothing(url: str) -> None:
    rounds = 6
    Store(url).close()
    writers = [writer(url, name, rounds, pause=True) for name in ("Anna", "Ben")]
    for process in writers:  # both are ready before either begins
        assert process.stdout is not None and process.stdout.readline() == "open\n"
    for process in writers:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    for process in writers:
        output, _ = process.communicate(timeout=300)
        assert process.returncode == 0
        assert output.count("decided") == rounds
    with Store(url) as store:
        assert list(store.check()) == []
        names = {f"{who} {i}.jpg" for who in ("Anna", "Ben", "shared") for i in range(rounds)}
        assert {photo.name for photo in store.photos()} == names and len(store.photos()) == 3 * rounds
        assert store.stats()["decisions_by"] == {
            "program cadpose": 5 * rounds, "human Anna": rounds, "human Ben": rounds,
        }  # fmt: skip
        assert {f.attempts for f in store.photo_failures()} == {2}


def test_threads_that_annotate_the_same_photos_take_turns(url: str) -> None:
    errors: list[Exception] = []

    def write(worker: int) -> None:
        try:
            with Store(url) as store:
                for i in range(6):
                    store.add(make_document(f"{i % 3}.jpg", annotations=1 + worker))
        except Exception as error:
            errors.append(error)

    workers = [threading.Thread(target=write, args=(worker,)) for worker in range(3)]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert errors == []
    with Store(url) as store:
        assert len(store.photos()) == 3 and list(store.check()) == []


def test_two_reviewers_at_once_never_both_win(url: str) -> None:
    with Store(url) as store:
        store.add(make_document("a.jpg", annotations=1))
        item = store.queue().items[0]
        start, won, lost = threading.Barrier(4), list[str](), list[str]()

        def review(name: str) -> None:
            start.wait()
            try:
                store.decide(item.annotation_id, "accept", Author(name), expected_version=item.version)
                won.append(name)
            except CadposeError as error:
                lost.append(str(error))

        people = [threading.Thread(target=review, args=(f"P{i}",)) for i in range(4)]
        for person in people:
            person.start()
        for person in people:
            person.join()
        assert len(won) == 1 and len(lost) == 3
        assert all(f"last by {won[0]}" in sentence for sentence in lost)
        assert len(store.history(item.annotation_id)) == 2


# -- full and read-only places ---------------------------------------------------------------------


@pytest.fixture
def few_pages() -> Iterator[None]:
    """SQLite files may grow to 400 kB only."""

    def limit(connection: Any, _: object) -> None:
        connection.execute("PRAGMA max_page_count=100")

    sa.event.listen(sa.Engine, "connect", limit)
    yield
    sa.event.remove(sa.Engine, "connect", limit)


def fill_up(store: Store) -> int:
    """Add until it is full; how many photos were added."""
    for i in range(400):
        try:
            store.add(make_document(f"{i}.jpg", annotations=3))
        except CadposeError as error:
            assert "cannot write the store" in str(error) and "full" in str(error)
            assert "free some space" in str(error) and "\n" not in str(error)
            return i
    pytest.fail("it never got full")


@pytest.mark.usefixtures("few_pages")
def test_a_full_store_keeps_what_it_has(tmp_path: Path) -> None:
    with Store(f"sqlite:///{tmp_path / 'a.db'}") as store:
        number = fill_up(store)
        assert number > 0 and len(store.photos()) == number
        assert list(store.check()) == []


@pytest.mark.usefixtures("few_pages")
def test_a_store_that_does_not_fit_is_merged_not_at_all(tmp_path: Path) -> None:
    with Store(f"sqlite:///{tmp_path / 'a.db'}") as one, Store(f"sqlite:///{tmp_path / 'b.db'}") as two:
        number = fill_up(one)
        two.add_many([make_document(f"two {i}.jpg", annotations=3) for i in range(5)])
        with pytest.raises(CadposeError, match="full"):
            one.merge(two)
        assert len(one.photos()) == number and list(one.check()) == []


@posix
def test_a_full_disk_gives_one_sentence_and_no_damage() -> None:
    with tempfile.TemporaryDirectory() as folder:
        mount = ["mount", "-t", "tmpfs", "-o", "size=900k", "none", folder]
        try:
            subprocess.run(mount, check=True, capture_output=True)
        except (OSError, subprocess.CalledProcessError):
            pytest.skip("needs to mount a small disk, which only root may")
        try:
            path = Path(folder) / "a.db"
            with Store(f"sqlite:///{path}") as store:
                number = fill_up(store)
                assert len(store.photos()) == number and list(store.check()) == []
            # Not even a new store fits beside it, nor the copy that a migration keeps.
            with pytest.raises(CadposeError, match="full"):
                Store(f"sqlite:///{Path(folder) / 'b.db'}")
            with Store(f"sqlite:///{path}") as store:
                assert len(store.photos()) == number and list(store.check()) == []
        finally:
            subprocess.run(["umount", folder], check=True)


def look_and_write(url: str) -> list[str]:
    """What a store says to somebody who may read it only."""
    said: list[str] = []
    try:
        with Store(url) as store:
            said.append(f"{len(store.photos())} photo, {len(list(store.check()))} problems")
            store.add(make_document("new.jpg"))
    except CadposeError as error:
        said.append(str(error))
    return said


def as_somebody_else(work: Callable[[], list[str]]) -> list[str]:
    """Do it in a process that is not root's, because root may write anywhere."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            if os.getuid() == 0:
                os.setgroups([])
                os.setgid(65534)
                os.setuid(65534)
            os.write(writing, "\n".join(work()).encode())
        except BaseException as error:
            os.write(writing, f"failed: {error!r}".encode())
        finally:
            os._exit(0)
    os.close(writing)
    with os.fdopen(reading) as stream:
        said = stream.read().splitlines()
    os.waitpid(child, 0)
    return said


@posix
@pytest.mark.parametrize("what", ["file", "folder"])
def test_a_read_only_place_gives_one_sentence_and_no_damage(what: str) -> None:
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        folder.chmod(0o755)
        path = folder / "a.db"
        with Store(f"sqlite:///{path}") as store:
            store.add(make_document("a.jpg"))
        before = path.read_bytes()
        path.chmod(0o444)
        folder.chmod(0o555 if what == "folder" else 0o777)
        said = as_somebody_else(lambda: look_and_write(f"sqlite:///{path}"))
        assert "the store" in said[-1] and "readonly" in said[-1], said
        assert "make file and folder writable" in said[-1] and str(path) in said[-1]
        if what == "file":
            assert said[:-1] == ["1 photo, 0 problems"]
        # A new store in a folder that may not be written to.
        if what == "folder":
            (sentence,) = as_somebody_else(lambda: look_and_write(f"sqlite:///{folder / 'new.db'}"))
            assert "cannot open the store" in sentence
        folder.chmod(0o755)
        assert path.read_bytes() == before
        with Store(f"sqlite:///{path}") as store:
            assert list(store.check()) == []
