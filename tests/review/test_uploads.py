"""Photos from the page: refused at the door, or annotated in the background into the store."""

from __future__ import annotations

import asyncio
import io
import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.errors import DependencyError
from cadpose.library.catalogue import Library
from cadpose.photos import MAX_BYTES, read_photo
from cadpose.review import jobs as jobs_module
from cadpose.review import uploads as uploads_module
from cadpose.review.answers import JobAnswer
from cadpose.review.starting import go_on
from cadpose.review.uploads import shown_name, sweep_parts
from cadpose.review.waiting import WaitingNotes
from tests.batch.fakes import FakeDetector, fake_annotator
from tests.review.serving import Served, digest, serve


@pytest.fixture
def empty(tmp_path: Path, small_library: Library) -> Iterator[Served]:
    """A newcomer's store, and an annotator without networks."""
    served = serve(
        tmp_path,
        small_library,
        annotator=lambda: fake_annotator(small_library, detector=FakeDetector(lamp=True)),
    )
    yield served
    served.close()


def picture(seed: int = 0, kind: str = "PNG", **options: Any) -> bytes:
    rgb = np.random.default_rng(seed).integers(0, 255, (60, 80, 3), np.uint8)
    out = io.BytesIO()
    Image.fromarray(rgb).save(out, kind, **options)
    return out.getvalue()


def upload(served: Served, data: bytes, name: str = "a.png", status: int = 202) -> Any:
    answer = served.client.post("/api/photos", params={"name": name}, content=data)
    assert answer.status_code == status, answer.text
    return answer.json()


def ended(served: Served, job_id: str) -> JobAnswer:
    shares = [0.0]
    for _ in range(600):
        told = JobAnswer.model_validate(served.get(f"/api/jobs/{job_id}"))
        assert told.share >= shares[-1]
        shares.append(told.share)
        if told.state in ("done", "failed"):
            return told
        time.sleep(0.02)
    raise AssertionError("the job does not end")


def test_a_photo_becomes_an_annotation(empty: Served) -> None:
    assert empty.get("/api/queue")["total"] == 0
    data = picture()
    queued = JobAnswer.model_validate(upload(empty, data, "holiday/chair 1.png"))
    assert queued.state in ("queued", "running", "done") and queued.name == "holiday/chair 1.png"
    told = ended(empty, queued.id)
    assert told.state == "done", told.error
    assert told.share == 1.0 and told.photo_sha256 == digest(data) and told.error is None
    (key,) = told.annotations
    found = empty.get(f"/api/annotations/{key}")
    assert found["photo"]["name"] == "holiday/chair 1.png" and found["photo"]["image"]
    assert empty.client.get(found["photo"]["image"]).headers["content-type"] == "image/jpeg"
    document = empty.desk.store.document(digest(data))
    assert document is not None and [f.stage for f in document.failures] == ["library"]
    # Beside the store, under a name that is its own digest; nothing unfinished is left.
    names = [path.name for path in empty.desk.photos.uploads.iterdir()]
    assert names == [f"{digest(data)}.png"]
    assert [job["id"] for job in empty.get("/api/jobs")["items"]] == [queued.id]


def test_the_same_photo_again(empty: Served) -> None:
    data = picture(kind="JPEG")
    first = ended(empty, upload(empty, data, "a.jpg")["id"])
    again = ended(empty, upload(empty, data, "b.jpg")["id"])
    assert again.annotations == first.annotations
    assert empty.get("/api/queue")["total"] == 1


@pytest.mark.parametrize(
    ("data", "word"),
    [
        (b"", "empty"),
        (b"<svg onload=alert(1)>", "not a photo"),
        (b"%PDF-1.7", "not a photo"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n", "not a photo"),
        (picture()[:200], "damaged"),
        (picture(kind="ICO"), "not a photo"),
    ],
)
def test_what_is_no_photo(empty: Served, data: bytes, word: str) -> None:
    told = upload(empty, data, "evil.png", 422)
    assert told["kind"] == "bad_input" and word in told["error"]
    # Neither places of the server nor names of its files are told.
    assert str(empty.desk.photos.uploads) not in told["error"]
    assert list(empty.desk.photos.uploads.iterdir()) == [] and empty.get("/api/jobs")["items"] == []


def test_a_photo_of_too_many_pixels(empty: Served) -> None:
    out = io.BytesIO()
    Image.new("1", (60_000, 1000)).save(out, "PNG")
    assert "megapixels" in upload(empty, out.getvalue(), "bomb.png", 422)["error"]


def test_a_photo_that_is_too_large(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(uploads_module, "MAX_BYTES", 1000)
    read = 0

    def pieces() -> Iterator[bytes]:
        nonlocal read
        for _ in range(10):
            read += 1
            yield b"x" * 400

    answer = empty.client.post("/api/photos?name=a.jpg", content=pieces())
    assert answer.status_code == 413 and answer.json()["kind"] == "too_large"
    assert list(empty.desk.photos.uploads.iterdir()) == []
    monkeypatch.undo()
    answer = empty.client.post("/api/photos", content=b"x", headers={"content-length": str(MAX_BYTES + 1)})
    assert answer.status_code == 413


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("../../etc/passwd", "etc/passwd"),
        ("C:\\Users\\me\\a.jpg", "Users/me/a.jpg"),
        ("a\x00b\nc.jpg", "a_b_c.jpg"),
        ("", "photo"),
        ("..", "photo"),
        ("/abs/olute.jpg", "abs/olute.jpg"),
        ("é" * 400 + ".jpg", "é" * 296 + ".jpg"),
    ],
)
def test_names(name: str, shown: str) -> None:
    assert shown_name(name) == shown


def test_a_hostile_name_writes_nowhere_else(empty: Served, tmp_path: Path) -> None:
    data = picture(3)
    told = ended(empty, upload(empty, data, "../../../evil.exe")["id"])
    assert told.name == "evil.exe"
    assert [p.name for p in empty.desk.photos.uploads.iterdir()] == [f"{digest(data)}.jpg"]
    assert not list(tmp_path.parent.glob("evil*"))


def test_a_photo_that_fails_is_told(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken() -> Any:
        raise DependencyError("the weights are missing: fetch them")

    monkeypatch.setattr(empty.desk.jobs, "_make", broken)
    told = ended(empty, upload(empty, picture(1), "first.png")["id"])
    assert (told.state, told.error) == ("failed", "the weights are missing: fetch them")
    (failure,) = empty.desk.store.photo_failures()
    assert failure.name == "first.png"
    monkeypatch.setattr(empty.desk.jobs, "_make", lambda: 1 // 0)
    told = ended(empty, upload(empty, picture(2), "second.png")["id"])
    assert told.state == "failed" and told.error is not None and "ZeroDivisionError" in told.error
    monkeypatch.undo()
    # The thread goes on with the next.
    assert ended(empty, upload(empty, picture(1), "first.png")["id"]).state == "done"
    assert [failure.name for failure in empty.desk.store.photo_failures()] == ["second.png"]


def test_too_many_wait(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jobs_module, "MOST_WAITING", 0)
    assert upload(empty, picture(), status=503)["kind"] == "busy"


def test_unknown_jobs(empty: Served) -> None:
    for name in ("0" * 16, "x", "../a"):
        assert empty.get(f"/api/jobs/{name}", 404)["kind"] == "not_found"


def test_the_example(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    # The small library has neither cups nor motorbikes.
    assert not empty.get("/api/session")["actions"]["example"]
    assert empty.post("/api/photos/example", {}, 422)["kind"] == "bad_input"
    pytest.importorskip("skimage", reason="needs cadpose[demo]")
    monkeypatch.setitem(uploads_module._EXAMPLES, "chair", "coffee")
    assert empty.get("/api/session")["actions"]["example"]
    told = ended(empty, empty.post("/api/photos/example", {}, 202)["id"])
    assert told.state == "done" and told.name == "coffee.png"


def test_parts_of_an_earlier_start_are_swept(tmp_path: Path) -> None:
    (tmp_path / ".upload-1").write_bytes(b"x")
    (tmp_path / "kept.jpg").write_bytes(b"x")
    sweep_parts(tmp_path)
    sweep_parts(tmp_path / "missing")
    assert [p.name for p in tmp_path.iterdir()] == ["kept.jpg"]


def test_stopping_ends_the_photo_under_way(empty: Served) -> None:
    class Slow(FakeDetector):
        def detect(self, photo: Any) -> Any:
            time.sleep(0.3)
            return super().detect(photo)

    empty.desk.jobs._make = lambda: fake_annotator(empty.desk.models.opened(), detector=Slow())
    first, second = (upload(empty, picture(seed), f"{seed}.png")["id"] for seed in (7, 8))
    time.sleep(0.1)
    empty.desk.jobs.stop()
    states = {job.id: job.state for job in empty.desk.jobs.all()}
    assert states[first] == "failed" and states[second] == "queued"
    # Neither failed by itself: the next start goes on with both, once each, by their names.
    assert empty.desk.store.photo_failures() == []
    again = restarted(empty)
    go_on(again.desk)
    jobs = {job["name"]: job["id"] for job in again.get("/api/jobs")["items"]}
    assert sorted(jobs) == ["7.png", "8.png"]
    assert all(ended(again, job).state == "done" for job in jobs.values())
    assert again.get("/api/queue")["total"] == 2
    assert not list(again.desk.photos.uploads.glob(".waiting-*"))
    go_on(again.desk)
    assert len(again.get("/api/jobs")["items"]) == 2
    again.close()


def restarted(served: Served) -> Served:
    """A second server on the same store and uploads, with a new annotator."""
    library = served.desk.models.opened()
    folder = served.desk.photos.uploads.parent
    return serve(folder, library, annotator=lambda: fake_annotator(library, detector=FakeDetector()))


def test_what_failed_or_is_gone_does_not_come_again(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(empty.desk.jobs, "_make", lambda: 1 // 0)
    assert ended(empty, upload(empty, picture(1), "failed.png")["id"]).state == "failed"
    uploads = empty.desk.photos.uploads
    assert not list(uploads.glob(".waiting-*"))
    notes = WaitingNotes(uploads)
    notes.add("0" * 64, "gone.png")
    (uploads / ".waiting-x").write_bytes(b"no digest")
    again = restarted(empty)
    go_on(again.desk)
    assert again.get("/api/jobs")["items"] == []
    again.close()


def test_no_more_than_fit_are_taken_up_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    notes = WaitingNotes(tmp_path)
    for number in range(5):
        notes.add(f"{number:064x}", f"{number}.png")
        os.utime(tmp_path / f".waiting-{number:064x}", ns=(number, number))
    assert notes.all(3) == [(f"{number:064x}", f"{number}.png") for number in range(3)]
    notes.drop(f"{0:064x}")
    notes.drop(f"{0:064x}")
    assert [name for _, name in notes.all(9)] == ["1.png", "2.png", "3.png", "4.png"]
    assert WaitingNotes(tmp_path / "missing").all(9) == []


def test_the_event_loop_does_not_wait_for_the_disk(empty: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither that nor decoding takes a thread of the quick requests."""
    seen: list[tuple[str, bool, float]] = []

    def watched(name: str, function: Any) -> Any:
        def call(*arguments: Any) -> Any:
            try:
                in_loop = asyncio.get_running_loop() is not None
            except RuntimeError:
                in_loop = False
            seen.append((name, in_loop, empty.desk.slow.limiter.borrowed_tokens))
            return function(*arguments)

        return call

    monkeypatch.setattr(uploads_module, "_AT_ONCE", 1000)
    monkeypatch.setattr(os, "fsync", watched("fsync", os.fsync))
    monkeypatch.setattr(uploads_module, "read_photo", watched("read_photo", read_photo))
    data = picture(5)
    assert ended(empty, upload(empty, data)["id"]).photo_sha256 == digest(data)
    first = seen[: [name for name, *_ in seen].index("read_photo") + 1]
    assert [name for name, *_ in first] == ["fsync", "read_photo"]
    assert all(not in_loop and threads == 1 for _, in_loop, threads in first)
