from __future__ import annotations

import contextlib
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.batch.detect import PhotoDetections, detect_photos, found_in
from cadpose.detection.coco_json import FileDetector
from cadpose.errors import CadposeError, DependencyError, InputError
from cadpose.geometry.boxes import Box
from cadpose.photos import read_photo
from cadpose.records import Detection, Mask, Photo
from tests.batch.fakes import FakeDetector, FakeMasks, files


def detect_all(photos: list[Path], **options: Path | None) -> list[PhotoDetections]:
    return list(detect_photos(FakeDetector(lamp=True), FakeMasks(), photos, **options))


def test_pictures_page_and_coco_file(photos: list[Path], tmp_path: Path) -> None:
    out, coco = tmp_path / "out" / "deep", tmp_path / "coco" / "all.json"
    found = detect_all(photos, out=out, coco=coco)
    assert [f.photo for f in found] == photos and not any(f.error for f in found)
    assert set(files(out)) == {"index.html", *(f"{n}.detections.png" for n in "abc")}
    for f in found:
        assert f.picture is not None
        Image.open(f.picture).load()
        chair, lamp = f.detections
        assert (chair.truncated, chair.tiny, lamp.truncated, lamp.tiny) == (False, False, True, True)
        assert chair.mask is not None and lamp.mask is not None
    read = FileDetector(coco)
    for f in found:
        again = read.detect(read_photo(f.photo))
        assert [(d.category, d.score, d.box) for d in again] == [
            (d.category, d.score, d.box) for d in f.detections
        ]
        assert all(
            a.mask is not None and b.mask is not None and (a.mask == b.mask).all()
            for a, b in zip(again, f.detections, strict=True)
        )


def test_nothing_is_written_unasked(photos: list[Path], tmp_path: Path) -> None:
    before = files(tmp_path)
    assert all(f.picture is None for f in detect_all(photos))
    assert files(tmp_path) == before


def test_a_photo_that_fails_is_told_and_the_others_go_on(photos: list[Path], tmp_path: Path) -> None:
    photos[1].write_bytes(b"no photo")
    coco = tmp_path / "all.json"
    found = detect_all(photos, out=tmp_path / "out", coco=coco)
    assert [bool(f.error) for f in found] == [False, True, False]
    assert str(photos[1]) in found[1].error and not found[1].detections
    names = [image["file_name"] for image in json.loads(coco.read_text())["images"]]
    assert names == [str(photos[0]), str(photos[2])]


class Broken(FakeDetector):
    def __init__(self, error: Exception) -> None:
        super().__init__()
        self.error = error

    def detect(self, photo: Photo) -> list[Detection]:
        raise self.error


def test_what_every_photo_needs_ends_the_run(photos: list[Path], tmp_path: Path) -> None:
    out, coco = tmp_path / "out", tmp_path / "all.json"
    with pytest.raises(DependencyError, match="weights"):
        list(detect_photos(Broken(DependencyError("no weights")), None, photos, out=out, coco=coco))
    assert files(out) == {} and not coco.exists()
    (first, *_) = detect_photos(Broken(ZeroDivisionError("oh")), None, photos)
    assert first.error == f"{photos[0]}: cannot be looked at (ZeroDivisionError: oh), --verbose tells more"


@pytest.mark.parametrize("error", [DependencyError("no weights"), ZeroDivisionError("oh")])
def test_a_run_that_does_no_photo_leaves_a_corrected_file_alone(
    photos: list[Path], tmp_path: Path, error: Exception
) -> None:
    coco, page = tmp_path / "all.json", tmp_path / "out" / "index.html"
    page.parent.mkdir()
    coco.write_text("corrected by hand")
    page.write_text("of the last run")
    with contextlib.suppress(DependencyError):
        list(detect_photos(Broken(error), None, photos, out=page.parent, coco=coco))
    assert coco.read_text() == "corrected by hand" and page.read_text() == "of the last run"


class TiresAfterOne(FakeDetector):
    def detect(self, photo: Photo) -> list[Detection]:
        if self.seen:
            raise DependencyError("no weights")
        return super().detect(photo)


def test_a_page_that_cannot_be_written_hides_no_error_and_skips_no_coco_file(
    photos: list[Path], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    coco, out = tmp_path / "all.json", tmp_path / "out"
    (out / "index.html").mkdir(parents=True)
    with pytest.raises(DependencyError, match="no weights"):
        list(detect_photos(TiresAfterOne(), None, photos, out=out, coco=coco))
    assert len(json.loads(coco.read_text())["images"]) == 1 and "index.html" in caplog.text
    with pytest.raises(CadposeError, match=r"index\.html"):
        detect_all(photos, out=out, coco=coco)
    assert len(json.loads(coco.read_text())["images"]) == 3


def test_no_output_takes_a_photos_place(photos: list[Path], tmp_path: Path) -> None:
    before = photos[0].read_bytes()
    with pytest.raises(InputError, match="one of the photos"):
        detect_all(photos, coco=photos[0])
    assert photos[0].read_bytes() == before
    taken = tmp_path / "taken"
    taken.write_text("mine")
    with pytest.raises(InputError, match="--out"):
        detect_all(photos, out=taken)
    with pytest.raises(CadposeError, match="--coco"):
        detect_all(photos, coco=taken / "all.json")


def test_a_detectors_own_mask_is_kept_and_none_is_made_unasked(photos: list[Path]) -> None:
    photo = read_photo(photos[0])
    own: Mask = np.ones((photo.height, photo.width), np.bool_)

    class Own(FakeDetector):
        def detect(self, photo: Photo) -> list[Detection]:
            return [Detection(Box(0, 0, 40, 40), "car", mask=own), Detection(Box(1, 1, 40, 40), "car")]

    first, second = found_in(photo, Own(), FakeMasks())
    assert first.mask is own and second.mask is not None
    first, second = found_in(photo, Own(), None)
    assert first.mask is own and second.mask is None
