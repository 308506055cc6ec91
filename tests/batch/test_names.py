"""Which file an output becomes: no other photo's, and never a photo."""

from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.annotations.document import AnnotationDocument
from cadpose.errors import InputError
from cadpose.pipeline import Annotator
from tests.batch.fakes import annotate_all, files, picture


def test_photos_of_one_stem_do_not_collide(annotator: Annotator, tmp_path: Path) -> None:
    photos = [
        picture(tmp_path / name, i)
        for i, name in enumerate(("x/car.png", "y/car.png", "y/CAR.jpg", "bus.png"))
    ]
    outcomes = annotate_all(annotator, photos, tmp_path / "out")
    assert len({p for o in outcomes for p in o.paths.all()}) == 24
    for outcome in outcomes:
        document = AnnotationDocument.from_json(outcome.paths.json.read_text())
        assert document.photo.name == str(outcome.photo)
    assert (tmp_path / "out" / "bus.json").is_file()


def test_a_later_run_spares_the_outputs_of_another_photo_of_that_stem(
    annotator: Annotator, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    first, second = (picture(tmp_path / folder / "car.png", i) for i, folder in enumerate("ab"))
    annotate_all(annotator, [first], out)
    before = files(out)
    for name in ("index.html", "report.html", "journal.jsonl"):
        del before[name]
    (outcome,) = annotate_all(annotator, [second], out)
    assert outcome.paths.json.name.startswith("car-") and outcome.document is not None
    assert outcome.document.photo.name == str(second)
    after = files(out)
    assert {name: after[name] for name in before} == before and len(after) == 13
    # Each is found again, and is replaced when it has changed itself.
    for photo, paths in ((first, out / "car.json"), (second, outcome.paths.json)):
        (again,) = annotate_all(annotator, [photo], out, resume=True)
        assert again.resumed and again.paths.json == paths
        picture(photo, 50 + (photo == first))
        (again,) = annotate_all(annotator, [photo], out, resume=True)
        assert not again.resumed and again.paths.json == paths
    assert len(files(out)) == 13


def test_a_photo_that_has_moved_keeps_its_outputs(annotator: Annotator, tmp_path: Path) -> None:
    out = tmp_path / "out"
    photo = picture(tmp_path / "a" / "car.png")
    annotate_all(annotator, [photo], out)
    (tmp_path / "b").mkdir()
    moved = photo.rename(tmp_path / "b" / "car.png")
    (again,) = annotate_all(annotator, [moved], out, resume=True)
    assert again.resumed and again.paths.json == out / "car.json"


def test_no_output_takes_the_place_of_a_photo(annotator: Annotator, tmp_path: Path) -> None:
    photos = [picture(tmp_path / name, i) for i, name in enumerate(("car.png", "car.overlay.png"))]
    before = files(tmp_path)
    with pytest.raises(InputError, match=r"car\.overlay\.png is one of the photos"):
        annotate_all(annotator, photos, tmp_path)
    assert files(tmp_path) == before


@pytest.mark.parametrize("way", ["dots", "link to the folder", "link to the photo"])
def test_no_other_way_to_a_photo_hides_it(annotator: Annotator, tmp_path: Path, way: str) -> None:
    folder = tmp_path / "photos"
    photos = [picture(folder / name, i) for i, name in enumerate(("car.png", "car.overlay.png"))]
    out = folder / ".." / "photos"
    if way == "link to the folder":
        out = tmp_path / "link"
        out.symlink_to(folder)
    elif way == "link to the photo":
        out = tmp_path / "out"
        out.mkdir()
        (tmp_path / "other.png").symlink_to(photos[1].rename(out / "car.overlay.png"))
        photos[1] = tmp_path / "other.png"
    before = files(tmp_path)
    with pytest.raises(InputError, match=r"car\.overlay\.png is one of the photos"):
        annotate_all(annotator, photos, out)
    assert files(tmp_path) == before


@pytest.mark.parametrize("name", ["index.html", "report.html", "journal.jsonl"])
def test_the_run_spares_a_photo_of_its_files_names(annotator: Annotator, tmp_path: Path, name: str) -> None:
    photo = picture(tmp_path / "index.png").rename(tmp_path / name)
    with pytest.raises(InputError, match=rf"{name} is one of the photos"):
        annotate_all(annotator, [photo], tmp_path)


def test_outputs_beside_the_photos(annotator: Annotator, photos: list[Path]) -> None:
    before = files(photos[0].parent)
    annotate_all(annotator, photos, photos[0].parent)
    after = files(photos[0].parent)
    assert {name: after[name] for name in before} == before and len(after) == 3 + 18


def test_no_document_takes_the_place_of_a_failure(annotator: Annotator, tmp_path: Path) -> None:
    """The document of car.failed.png would be car.failed.json, where car.png says why it failed."""
    photos = [picture(tmp_path / "in" / name, i) for i, name in enumerate(("car.png", "car.failed.png"))]
    photos[0].write_bytes(b"no picture")
    failed, done = annotate_all(annotator, photos, tmp_path / "out")
    assert failed.paths.failed.name == "car.failed.json" and failed.paths.failed.is_file()
    assert done.paths.json.name.startswith("car.failed-") and done.document is not None
