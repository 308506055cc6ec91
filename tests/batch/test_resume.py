"""What --resume leaves alone: bytes, options and the journal; failures; photos of the same bytes."""

from __future__ import annotations

import json
import logging
import os
from pathlib import Path

import pytest

from cadpose.annotations.store import Store
from cadpose.batch import resume as resume_module
from cadpose.batch.failures import read_failure
from cadpose.batch.journal import Journal
from cadpose.batch.outcome import read_document
from cadpose.library.catalogue import Library
from cadpose.pipeline import Annotator
from cadpose.records import Detection, Photo
from tests.batch.fakes import FakeDetector, annotate_all, fake_annotator, files


def again(annotator: Annotator, photos: list[Path], out: Path, **kwargs: object) -> list[bool]:
    """Which photos were left alone."""
    return [outcome.resumed for outcome in annotate_all(annotator, photos, out, resume=True, **kwargs)]


def test_finished_documents_are_not_read(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(path: Path) -> None:
        raise AssertionError(f"{path} was read")

    annotate_all(annotator, photos, tmp_path)
    monkeypatch.setattr(resume_module, "read_document", read)
    assert again(annotator, photos, tmp_path) == [True] * 3
    # A photo that was touched is read, not annotated.
    os.utime(photos[0])
    assert again(annotator, photos, tmp_path) == [True] * 3


def test_other_options_do_photos_again_and_say_so(
    small_library: Library, photos: list[Path], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    annotate_all(fake_annotator(small_library), photos, tmp_path)
    for changes in ({"candidates": 1}, {"align_to": "mask"}, {"seed": 3}, {"categories": ["chair"]}):
        caplog.clear()
        with caplog.at_level(logging.WARNING, logger="cadpose"):
            annotator = fake_annotator(small_library, **changes)
            assert again(annotator, photos, tmp_path) == [False] * 3, changes
        assert "3 finished photos were made with other options" in caplog.text
        assert again(annotator, photos, tmp_path) == [True] * 3


def test_told_objects_belong_to_the_options(annotator: Annotator, photos: list[Path], tmp_path: Path) -> None:
    def given(photo: Photo) -> list[Detection]:
        return FakeDetector().detect(photo)

    annotate_all(annotator, photos, tmp_path, detections=given, told="file 1")
    assert again(annotator, photos, tmp_path, detections=given, told="file 1") == [True] * 3
    assert again(annotator, photos, tmp_path, detections=given, told="file 2") == [False] * 3
    assert again(annotator, photos, tmp_path) == [False] * 3


@pytest.mark.parametrize("damage", ["gone", "cut", "noise", "other"])
def test_a_damaged_journal_costs_time_only(
    annotator: Annotator, photos: list[Path], tmp_path: Path, damage: str
) -> None:
    annotate_all(annotator, photos, tmp_path)
    journal = tmp_path / "journal.jsonl"
    data = journal.read_bytes()
    if damage == "gone":
        journal.unlink()
    else:
        noise = os.urandom(4000) + b"\n[1, 2]\n{}\n" + b'{"stem": "a", "record": {"photo": 3}}\n'
        journal.write_bytes({"cut": data[:-40], "noise": noise + data, "other": b"[" * 100_000}[damage])
    assert again(annotator, photos, tmp_path) == [True] * 3
    assert set(Journal(tmp_path).records()) == {"a", "b", "c"}


@pytest.mark.parametrize("journal", ["there", "gone"])
def test_a_picture_that_was_cut_short_is_made_again(
    annotator: Annotator, photos: list[Path], tmp_path: Path, journal: str
) -> None:
    done = annotate_all(annotator, photos[:2], tmp_path)
    overlay = done[0].paths.overlay
    overlay.write_bytes(overlay.read_bytes()[:-20])
    if journal == "gone":
        Journal(tmp_path).path.unlink()
    assert again(annotator, photos[:2], tmp_path) == [False, True]
    assert again(annotator, photos[:2], tmp_path) == [True, True]


def test_without_a_journal_told_objects_are_not_taken_for_found_ones(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    given = FakeDetector().detect
    for told in ({"detections": given, "told": "file 1"}, {"detections": given, "told": "file 2"}, {}):
        Journal(tmp_path).path.unlink(missing_ok=True)
        assert again(annotator, photos[:1], tmp_path, **told) == [False]
    Journal(tmp_path).path.unlink()
    assert again(annotator, photos[:1], tmp_path) == [True]


def test_a_folder_of_an_earlier_version_gets_thumbnails_and_a_journal(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    annotate_all(annotator, photos, tmp_path)
    whole = files(tmp_path)
    for name in whole:
        if name.startswith("thumbnails/") or name == "journal.jsonl":
            (tmp_path / name).unlink()
    assert again(annotator, photos, tmp_path) == [True] * 3
    assert set(files(tmp_path)) == set(whole)


def test_a_line_without_a_document_vouches_for_nothing(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    """A kill between the two."""
    first = annotate_all(annotator, photos, tmp_path)
    first[1].paths.json.unlink()
    index = (tmp_path / "index.html").read_text()
    assert "b.card.html" in index
    assert again(annotator, photos, tmp_path) == [True, False, True]


def test_failures_are_kept_left_alone_and_tried_again(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    class Broken(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            if photo.name.endswith("b.png"):
                raise ValueError("odd")
            return super().detect(photo)

    url, out = f"sqlite:///{tmp_path / 'all.db'}", tmp_path / "out"
    broken = fake_annotator(small_library, detector=Broken())
    with Store(url) as store:
        (_, failed, _) = annotate_all(broken, photos, out, store=store)
        failure = read_failure(failed.paths.failed)
        assert failure is not None and failure.stage == "detect" == failed.stage
        assert failure.reason == failed.error and "odd" in failure.reason and str(photos[1]) in failure.reason
        assert [(f.name, f.stage) for f in store.photo_failures()] == [(str(photos[1]), "detect")]
        kept = annotate_all(broken, photos, out, store=store, resume=True)
        assert all(outcome.resumed for outcome in kept) and kept[1].error == failed.error
        annotator = fake_annotator(small_library)
        # The same options: the failure stays until it is to be tried again.
        assert again(annotator, photos, out, store=store) == [True] * 3
        assert again(annotator, photos, out, store=store, retry_failed=True) == [True, False, True]
        assert not failed.paths.failed.exists() and failed.paths.json.is_file()
        assert not store.photo_failures() and len(store.photos()) == 3
    report = (out / "report.html").read_text()
    assert "odd" not in report


def test_a_failure_is_tried_again_where_bytes_or_options_have_changed(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    data = photos[0].read_bytes()
    photos[0].write_bytes(b"no picture")
    annotate_all(fake_annotator(small_library), photos, tmp_path)
    assert again(fake_annotator(small_library), photos, tmp_path) == [True] * 3
    assert again(fake_annotator(small_library, seed=1), photos, tmp_path) == [False] * 3
    photos[0].write_bytes(data)
    assert again(fake_annotator(small_library, seed=1), photos, tmp_path) == [False, True, True]


def test_photos_that_cannot_be_read_for_a_while_keep_their_outputs(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    """A disk that is not there: nothing is lost, and all is as it was when it is back."""
    out = tmp_path / "out"
    annotate_all(annotator, photos, out)
    away = photos[0].parent.rename(tmp_path / "away")
    assert all(outcome.error for outcome in annotate_all(annotator, photos, out, resume=True))
    assert len(list(out.glob("*.failed.json"))) == 3
    away.rename(photos[0].parent)
    outcomes = annotate_all(annotator, photos, out, resume=True)
    assert all(outcome.resumed and not outcome.error for outcome in outcomes)
    assert not list(out.glob("*.failed.json"))


def test_the_same_bytes_are_annotated_once_and_told(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    copy = photos[0].with_name("copy.png")
    copy.write_bytes(photos[0].read_bytes())
    outcomes = annotate_all(annotator, [photos[0], copy, photos[1]], tmp_path / "out")
    assert [o.same_as for o in outcomes] == [None, photos[0], None]
    assert outcomes[1].record == outcomes[0].record and outcomes[1].paths == outcomes[0].paths
    assert not (tmp_path / "out" / "copy.json").exists()
    detector = annotator.detector
    assert isinstance(detector, FakeDetector) and len(detector.seen) == 2
    # Where what is told goes by name, both are done.
    named = annotate_all(annotator, [photos[0], copy], tmp_path / "named", detections=FakeDetector().detect)
    assert [o.same_as for o in named] == [None, None] and (tmp_path / "named" / "copy.json").is_file()


def test_a_store_gets_what_a_kill_kept_from_it(
    annotator: Annotator, photos: list[Path], tmp_path: Path
) -> None:
    out = tmp_path / "out"
    done = annotate_all(annotator, photos, out)
    with Store(f"sqlite:///{tmp_path / 'all.db'}") as store:
        document = read_document(done[1].paths.json)
        assert document is not None
        store.add(document)
        assert again(annotator, photos, out, store=store) == [True] * 3
        assert len(store.photos()) == 3
    detector = annotator.detector
    assert isinstance(detector, FakeDetector) and len(detector.seen) == 3


def test_a_store_that_holds_an_older_document_gets_the_finished_one(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    out, newer = tmp_path / "out", fake_annotator(small_library, seed=3)
    with Store(f"sqlite:///{tmp_path / 'all.db'}") as store:
        annotate_all(fake_annotator(small_library), photos[:1], out, store=store)
        (done,) = annotate_all(newer, photos[:1], out)
        assert again(newer, photos[:1], out, store=store) == [True]
        assert done.record is not None and store.document(done.record.sha256) == done.document


def test_categories_are_told_by_documents_too(
    small_library: Library, photos: list[Path], tmp_path: Path
) -> None:
    annotate_all(fake_annotator(small_library, categories=["chair"]), photos[:1], tmp_path)
    Journal(tmp_path).path.unlink()
    assert again(fake_annotator(small_library), photos[:1], tmp_path) == [False]


def test_the_journal_is_made_short_again(
    annotator: Annotator, photos: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for _ in range(6):
        annotate_all(annotator, photos, tmp_path)
    journal = Journal(tmp_path)
    assert len(journal.path.read_text().splitlines()) == 18
    before = journal.records()
    monkeypatch.setattr("cadpose.batch.journal._WORTH_CLEANING", 1)
    journal.tidy()
    assert [json.loads(line)["stem"] for line in journal.path.read_text().splitlines()] == ["a", "b", "c"]
    assert journal.records() == before
