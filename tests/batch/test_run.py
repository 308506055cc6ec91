from __future__ import annotations

import hashlib
import json
import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image

from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.files import OutputPaths
from cadpose.annotations.store import Store
from cadpose.batch import run
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo
from tests.batch.fakes import FakeDetector, annotate_all, fake_annotator, files, picture


def test_every_output_is_written_and_whole(annotator: Annotator, photos: list[Path], tmp_path: Path) -> None:
    out = tmp_path / "out" / "deep"
    outcomes = annotate_all(annotator, photos, out)
    assert [o.photo for o in outcomes] == photos
    for outcome in outcomes:
        assert not outcome.error and not outcome.resumed and outcome.seconds
        assert outcome.document is not None and len(outcome.document.annotations) == 1
        assert AnnotationDocument.from_json(outcome.paths.json.read_text()) == outcome.document
        assert outcome.document.photo.sha256 == hashlib.sha256(outcome.photo.read_bytes()).hexdigest()
        for path in (outcome.paths.overlay, outcome.paths.candidates):
            Image.open(path).load()
        with Image.open(outcome.paths.thumbnail) as small:
            assert max(small.size) <= 320
        assert outcome.paths.card.read_text().endswith("</html>\n")
    index = (out / "index.html").read_text()
    assert all(f'{name}.card.html"' in index for name in "abc")
    assert len(files(out)) == 18


def test_the_document_comes_last(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also in a second run: a document of the first must not vouch for the second's pictures."""
    annotate_all(annotator, photos[:1], tmp_path / "out")
    moved: list[str] = []
    real = Path.replace

    def spy(self: Path, target: Path) -> Path:
        moved.append(target.name)
        assert not (tmp_path / "out" / "a.json").exists() or target.suffix == ".html"
        return real(self, target)

    monkeypatch.setattr(Path, "replace", spy)
    annotate_all(annotator, photos[:1], tmp_path / "out")
    names = ["a.overlay.png", "a.candidates.png", "a.card.html", "a.jpg", "a.json"]
    assert moved == [*names, "index.html", "report.html"]


@pytest.mark.parametrize("trouble", ["disk", "store", "interrupt"])
def test_a_rerun_that_fails_leaves_what_was_finished(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, trouble: str
) -> None:
    out = tmp_path / "out"
    annotate_all(annotator, photos[:1], out)
    before = {name: data for name, data in files(out).items() if name.startswith(("a.", "thumbnails/"))}

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    def broken(document: AnnotationDocument) -> bool:
        raise KeyboardInterrupt if trouble == "interrupt" else CadposeError("cannot write the store: gone")

    with Store("sqlite://") as store, pytest.raises((CadposeError, KeyboardInterrupt)):
        if trouble == "disk":
            monkeypatch.setattr(os, "fsync", full)
        monkeypatch.setattr(store, "add", broken)
        annotate_all(annotator, photos[:1], out, store=store)
    assert {name: data for name, data in files(out).items() if name in before} == before
    assert not [name for name in files(out) if ".part" in name]


def test_a_photo_that_fails_does_not_stop_the_others(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    photos[1].write_bytes(b"no picture")
    first, second, third = annotate_all(annotator, photos, tmp_path / "out")
    assert first.document is not None and third.document is not None
    assert second.document is None and str(photos[1]) in second.error
    assert [p for p in second.paths.all() if p.exists()] == [second.paths.failed]
    index = (tmp_path / "out" / "index.html").read_text()
    assert "a.card.html" in index and "c.card.html" in index and "b.card.html" not in index


@pytest.mark.parametrize("error", [ValueError("odd"), OSError(28, "No space left on device"), MemoryError()])
def test_whatever_a_photo_brings_to_light_the_others_go_on(
    small_library: Library,
    photos: list[Path],
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    error: Exception,
) -> None:
    class Broken(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            if photo.name.endswith("b.png"):
                raise error
            return super().detect(photo)

    with caplog.at_level(logging.DEBUG, logger="cadpose"):
        outcomes = annotate_all(fake_annotator(small_library, detector=Broken()), photos, tmp_path / "out")
    assert [bool(o.error) for o in outcomes] == [False, True, False]
    assert outcomes[1].error.startswith(f"{photos[1]}: cannot be annotated ({type(error).__name__}")
    assert [r.exc_info[1] for r in caplog.records if r.exc_info] == [error]


def test_missing_weights_stop_the_run(small_library: Library, photos: list[Path], tmp_path: Path) -> None:
    class NoWeights(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            raise DependencyError("the weights are missing")

    annotator = fake_annotator(small_library, detector=NoWeights())
    with pytest.raises(DependencyError):
        annotate_all(annotator, photos, tmp_path / "out")


def test_failures_and_given_detections_are_in_the_document(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    annotator = fake_annotator(small_library, detector=FakeDetector(lamp=True))
    (outcome,) = annotate_all(annotator, photos[:1], tmp_path / "out")
    assert outcome.document is not None
    assert [f.stage for f in outcome.document.failures] == ["library"]
    assert len(outcome.document.annotations) == 1

    def given(photo: Photo) -> list[Detection]:
        return [Detection(Box(1, 2, 30, 40), "car"), Detection(Box(10, 2, 70, 40), "chair")]

    (outcome,) = annotate_all(annotator, photos[:1], tmp_path / "out", detections=given)
    assert outcome.document is not None
    assert [a.detection.category for a in outcome.document.annotations] == ["car", "chair"]


def test_a_photo_without_objects_is_done_too(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    (outcome,) = annotate_all(annotator, photos[:1], tmp_path / "out", detections=lambda photo: [])
    assert outcome.document is not None and not outcome.document.annotations
    assert all(p.is_file() for p in outcome.paths.results())


# -- resume ----------------------------------------------------------------------------------------


def test_resume_leaves_finished_photos_alone(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    first = annotate_all(annotator, photos, out)
    before = files(out)
    again = annotate_all(annotator, photos, out, resume=True)
    assert all(o.resumed for o in again)
    assert [o.document for o in again] == [o.document for o in first]
    after = files(out)
    assert b"nothing left to do" in after.pop("report.html") and before.pop("report.html")
    assert after == before, "the index too is the same"
    detector = annotator.detector
    assert isinstance(detector, FakeDetector) and len(detector.seen) == 3
    assert not any(o.resumed for o in annotate_all(annotator, photos, out))


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-20])


@pytest.mark.parametrize(
    "spoil",
    [
        lambda photo, paths: picture(photo, 99),
        lambda photo, paths: paths.json.unlink(),
        lambda photo, paths: paths.overlay.unlink(),
        lambda photo, paths: paths.candidates.unlink(),
        lambda photo, paths: paths.card.unlink(),
        lambda photo, paths: cut(paths.json),
        lambda photo, paths: paths.json.write_bytes(b"\xff\xfe"),
        lambda photo, paths: paths.overlay.write_bytes(b""),
    ],
    ids=["other bytes", "no json", "no overlay", "no strip", "no card", "cut json", "no utf-8", "no picture"],
)
def test_resume_does_again_what_is_not_whole(
    annotator: Annotator, photos: list[Path], tmp_path: Path, spoil: Callable[[Path, OutputPaths], object]
) -> None:
    out = tmp_path / "out"
    first = annotate_all(annotator, photos[:2], out)
    spoil(photos[0], first[0].paths)
    again = annotate_all(annotator, photos[:2], out, resume=True)
    assert [o.resumed for o in again] == [False, True]
    assert all(p.is_file() for p in again[0].paths.results())
    assert again[0].document is not None
    assert again[0].document.photo.sha256 == hashlib.sha256(photos[0].read_bytes()).hexdigest()


# -- store -----------------------------------------------------------------------------------------


def test_the_store_gets_the_same_documents(annotator: Annotator, photos: list[Path], tmp_path: Path) -> None:
    with Store(f"sqlite:///{tmp_path / 'all.db'}") as store:
        photos[2].write_bytes(b"")
        outcomes = annotate_all(annotator, photos, tmp_path / "out", store=store)
        assert len(store.photos()) == 2
        for outcome in outcomes[:2]:
            assert outcome.document is not None
            assert store.document(outcome.document.photo.sha256) == outcome.document
    # What was done before there was a store gets into it by --resume.
    with Store(f"sqlite:///{tmp_path / 'late.db'}") as store:
        again = annotate_all(annotator, photos[:2], tmp_path / "out", store=store, resume=True)
        assert all(o.resumed for o in again) and len(store.photos()) == 2


def test_a_store_that_cannot_be_written_stops_the_run(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Store("sqlite://") as store:

        def full(document: AnnotationDocument) -> bool:
            raise CadposeError("cannot write the store memory: disk full")

        monkeypatch.setattr(store, "add", full)
        with pytest.raises(CadposeError, match="disk full"):
            annotate_all(annotator, photos, tmp_path / "out", store=store)
    assert (tmp_path / "out" / "index.html").is_file()


# -- places and interruptions ----------------------------------------------------------------------


def test_a_place_that_cannot_be_used(annotator: Annotator, photos: list[Path], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("here")
    for out in (tmp_path / "file", tmp_path / "file" / "below"):
        with pytest.raises(InputError, match=rf"{out}: cannot be made \(.+\), choose another --out"):
            annotate_all(annotator, photos, out)
    assert (tmp_path / "file").read_text() == "here"


def test_a_full_disk_fails_photos_in_one_sentence_and_leaves_nothing(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "out"
    real, count = os.fsync, 0

    def full(handle: int) -> None:
        nonlocal count
        count += 1
        if 3 <= count <= 4:
            raise OSError(28, "No space left on device")
        real(handle)

    monkeypatch.setattr(os, "fsync", full)
    outcomes = annotate_all(annotator, photos, out)
    assert ["No space left on device" in o.error for o in outcomes] == [True, True, False]
    assert not list(out.glob("*.part")) + list(out.glob(".*"))
    for outcome in outcomes:
        assert outcome.paths.json.exists() == (not outcome.error)


def test_a_stopped_run_still_writes_its_index(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    class Stopped(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            if photo.name.endswith("b.png"):
                raise KeyboardInterrupt
            return super().detect(photo)

    with pytest.raises(KeyboardInterrupt):
        annotate_all(fake_annotator(small_library, detector=Stopped()), photos, tmp_path / "out")
    index = (tmp_path / "out" / "index.html").read_text()
    assert "a.card.html" in index and "b.card.html" not in index


def test_pages_that_cannot_be_written_hide_no_interrupt(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    (tmp_path / "out" / "index.html").mkdir(parents=True)
    outcomes = run.annotate_photos(annotator, photos, tmp_path / "out")
    next(outcomes)
    with pytest.raises(KeyboardInterrupt):
        outcomes.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
    with pytest.raises(CadposeError, match=r"index\.html"):
        annotate_all(annotator, photos[:1], tmp_path / "out")


def test_no_table_takes_the_place_of_a_photo_or_a_folder(photos: list[Path], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.png is one of the photos .* choose another --parquet"):
        run._ready(tmp_path / "out", photos, [], photos[0])
    with pytest.raises(InputError, match="is a folder: name a file with --parquet"):
        run._ready(tmp_path / "out", photos, [], tmp_path)
    assert not (tmp_path / "out").exists()


def test_leftovers_of_a_killed_run_are_swept_away(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    old, young, other = (out / n for n in (".cadpose-0.part", ".cadpose-1.part", "mine.part"))
    for path in (old, young, other):
        path.write_bytes(b"half")
        os.utime(path, (time.time() - 7200,) * 2)
    os.utime(young)
    folder = out / ".cadpose-2.part"
    folder.mkdir()
    os.utime(folder, (time.time() - 7200,) * 2)
    annotate_all(annotator, photos[:1], out)
    assert [p.exists() for p in (old, young, other, folder)] == [False, True, True, True]


KILLED = """
import os, signal, sys
from pathlib import Path
from cadpose.batch.run import annotate_photos
from tests.batch.fakes import fake_annotator
library, photos, out, *moments = sys.argv[1:]
photos = sorted(Path(photos).iterdir())
annotator = fake_annotator(Path(library))
annotator.library.mesh(annotator.library.models("chair")[0])
for k in map(int, moments):
    child = os.fork()
    if not child:
        real, count = os.fsync, 0
        def kill_at_k(handle):
            global count
            count += 1
            if count == k:
                os.kill(os.getpid(), signal.SIGKILL)
            real(handle)
        os.fsync = kill_at_k
        list(annotate_photos(annotator, photos, Path(out, str(k))))
        os._exit(0)
    print(k, os.waitpid(child, 0)[1], flush=True)
"""


def test_a_killed_process_leaves_whole_files_only(
    annotator: Annotator, small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    """SIGKILL at a flush to the disk: a photo's 5 files are flushed, moved, and their folders flushed."""
    moments = [str(k) for k in (1, 3, 5, 6, 7, 8, 9, 13, 27)]
    arguments = [str(small_library.path), str(photos[0].parent), str(tmp_path / "killed")]
    done = subprocess.run(
        [sys.executable, "-c", KILLED, *arguments, *moments],
        capture_output=True,
        text=True,
        timeout=120,
        cwd=Path(__file__).parents[2],
        check=True,
    )
    assert done.stdout.split() == [text for k in moments for text in (k, "9")]
    annotate_all(annotator, photos, tmp_path / "whole")
    names = set(files(tmp_path / "whole"))
    for k in moments:
        out = tmp_path / "killed" / k
        found = files(out)
        hidden = {name for name in found if ".cadpose-" in name and name.endswith(".part")}
        assert len(hidden) <= 5 and set(found) - hidden <= names
        for name in set(found) - hidden:
            if name.endswith((".png", ".jpg")):
                Image.open(out / name).load()
            elif name.endswith(".html"):
                assert found[name].endswith(b"</html>\n")
            elif name == "journal.jsonl":
                assert found[name].endswith(b"}\n")
            else:
                assert json.loads(found[name])["schema"] == "cadpose.annotation/1"
                stem = name.removesuffix(".json")
                drawn = {f"{stem}.overlay.png", f"{stem}.candidates.png", f"{stem}.card.html"}
                assert {*drawn, f"thumbnails/{stem}.jpg"} <= set(found)
    # The next run takes up where the killed one was.
    out = tmp_path / "killed" / "13"
    again = annotate_all(annotator, photos, out, resume=True)
    assert [o.resumed for o in again] == [True, False, False]
    assert {n for n in files(out) if ".cadpose-" not in n} == names


def test_swept_folders_may_be_shared(tmp_path: Path) -> None:
    run._sweep(tmp_path)
    assert not list(tmp_path.iterdir())
