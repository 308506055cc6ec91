"""Which photos, which candidates, whose boxes, whose rotations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.datasets.gallery import Gallery
from cadpose.datasets.labels import Label
from cadpose.errors import InputError, LibraryError
from cadpose.evaluation.retrieval_inputs import (
    RejectedError,
    choose_labels,
    detected_box,
    gallery_candidates,
    labelled_box,
    library_candidates,
    predicted_rotation,
    rotations_of_file,
    shuffled,
    true_rotation,
)
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.records import Detection, Photo, Rotation, RotationHypothesis
from tests.batch.fakes import FakeDetector, FakeRotation, fake_annotator
from tests.evaluation.retrieving import label

PHOTO = Photo(np.full((60, 80, 3), 90, np.uint8), "a.png")
BOX = Box(10, 10, 50, 40)


def write(folder: Path, entries: list[dict[str, Any]], name: str = "labels.json") -> Path:
    path = folder / name
    path.write_text(json.dumps(entries))
    return path


def entries(count: int, **more: Any) -> list[dict[str, Any]]:
    return [{"photo": f"{i}.png", "category": "car", "cad": "a", **more} for i in range(count)]


def names(labels: list[Label]) -> list[str]:
    return [one.photo.stem for one in labels]


# -- photos ---------------------------------------------------------------------------------------


def test_halves_are_of_each_category(tmp_path: Path) -> None:
    both = [*entries(4), *({**e, "photo": f"c{e['photo']}", "category": "chair"} for e in entries(3))]
    path = write(tmp_path, both)
    assert names(choose_labels(path, split="odd")) == ["0", "2", "c0", "c2"]
    assert names(choose_labels(path, split="even")) == ["1", "3", "c1"]
    assert names(choose_labels(path)) == names(choose_labels(path, split="all"))
    # The same halves whatever the category asked for.
    assert names(choose_labels(path, "chair", "odd")) == ["c0", "c2"]


def test_labels_without_a_model_do_not_count(tmp_path: Path) -> None:
    some = entries(5)
    del some[1]["cad"]
    path = write(tmp_path, some)
    assert names(choose_labels(path, split="odd")) == ["0", "3"]
    with pytest.raises(InputError, match="no label names its cad"):
        choose_labels(write(tmp_path, [{"photo": "a", "category": "car"}]))


def test_a_limit_is_spread_over_each_category(tmp_path: Path) -> None:
    mixed = [e | ({"category": "chair"} if i % 5 == 0 else {}) for i, e in enumerate(entries(20))]
    path = write(tmp_path, mixed)
    assert names(choose_labels(path, "car", limit=3)) == ["1", "11", "19"]
    # In the file's order, the categories among one another.
    assert names(choose_labels(path, limit=2)) == ["0", "1", "15", "19"]
    assert len(choose_labels(path, limit=100)) == 20


def test_another_word_is_a_split_of_the_labels(tmp_path: Path) -> None:
    path = write(tmp_path, [e | {"split": "val" if i else "train"} for i, e in enumerate(entries(3))])
    assert names(choose_labels(path, split="val")) == ["1", "2"]
    with pytest.raises(InputError, match="no label of split 'test'"):
        choose_labels(path, split="test")
    with pytest.raises(InputError, match="no even half"):
        choose_labels(write(tmp_path, entries(1)), split="even")


def test_real_and_synthetic_photos_are_not_mixed(tmp_path: Path) -> None:
    drawn = entries(2, synthetic=True)
    assert all(one.synthetic for one in choose_labels(write(tmp_path, drawn)))
    with pytest.raises(InputError, match=r"labels\.json: holds 2 synthetic and 3 real photos"):
        choose_labels(write(tmp_path, [*drawn, *entries(3)]))


# -- candidates -----------------------------------------------------------------------------------


def gallery(ids: tuple[str, ...], **category_of: str) -> Gallery:
    return Gallery(Path("g.json"), ids, category_of)


def test_a_gallery_is_cut_to_the_category(small_library: Library) -> None:
    everything = tuple(cad.id for cad in small_library.models())
    of = gallery_candidates(small_library, gallery(everything))
    assert [cad.id for cad in of(label(category="chair"))] == [
        "made/chair/plain.obj",
        "made/chair/throne.glb",
    ]
    with pytest.raises(InputError, match=r"a\.png: the gallery has no CAD model of category 'boat'"):
        of(label(category="boat"))


def test_galleries_that_do_not_fit_the_library(small_library: Library) -> None:
    with pytest.raises(LibraryError, match="nonsense"):
        gallery_candidates(small_library, gallery(("nonsense",)))
    wrong = Gallery(Path("g.json"), ("made/car/hatch.obj",), {"made/car/hatch.obj": "truck"})
    with pytest.raises(
        InputError, match=r"g\.json: names made/car/hatch\.obj under truck, the library as car"
    ):
        gallery_candidates(small_library, wrong)


def test_without_a_gallery_the_true_model_is_always_there(small_library: Library) -> None:
    one = small_library.representatives("car", 1)[0].id
    of = library_candidates(small_library, 1)
    assert [cad.id for cad in of(label(one))] == [one]
    other = next(cad.id for cad in small_library.models("car") if cad.id != one)
    assert [cad.id for cad in of(label(other))] == [one, other]
    with pytest.raises(LibraryError, match="nonsense"):
        of(label("nonsense"))
    with pytest.raises(InputError, match="is labelled car, its model chair"):
        of(label("made/chair/plain.obj"))


def test_the_order_shown_depends_on_photo_and_seed_alone(small_library: Library) -> None:
    cads = small_library.models()
    shown = [c.id for c in shuffled(cads, label(name="x.png"), 0)]
    assert sorted(shown) == sorted(c.id for c in cads)
    assert shown == [c.id for c in shuffled(cads[::-1], label(name="x.png"), 0)]
    orders = {tuple(c.id for c in shuffled(cads, label(name=f"{i}.png"), 0)) for i in range(20)}
    assert len(orders) > 10
    by_seed = {tuple(c.id for c in shuffled(cads, label(name="x.png"), seed)) for seed in range(20)}
    assert len(by_seed) > 10


# -- boxes ----------------------------------------------------------------------------------------


class Detects(FakeDetector):
    def __init__(self, *found: Detection) -> None:
        super().__init__()
        self.found = list(found)

    def detect(self, photo: Photo) -> list[Detection]:
        return self.found


def test_the_surest_detection_in_the_right_place(small_library: Library) -> None:
    assert labelled_box(label(), PHOTO, BOX) is BOX
    near, nearer = Box(12, 10, 52, 40), Box(10, 10, 50, 41)
    detector = Detects(
        Detection(nearer, "car", 0.5),
        Detection(near, "car", 0.7),
        Detection(Box(60, 0, 80, 20), "car", 0.99),
        Detection(BOX, "chair", 0.95),
    )
    found = detected_box(fake_annotator(small_library, detector=detector))
    assert found(label(), PHOTO, BOX) == near


def test_what_the_detector_misses_is_rejected(small_library: Library) -> None:
    def of(*found: Detection) -> Box:
        return detected_box(fake_annotator(small_library, detector=Detects(*found)))(label(), PHOTO, BOX)

    with pytest.raises(RejectedError, match="no object was found at the labelled box"):
        of()
    with pytest.raises(RejectedError, match="no object was found"):
        of(Detection(Box(40, 10, 79, 40), "car", 0.9), Detection(Box(-20, 0, -1, 9), "car", 0.9))
    with pytest.raises(RejectedError, match="car taken for chair"):
        of(Detection(BOX, "chair", 0.9), Detection(BOX, "lamp", 0.4))


# -- rotations ------------------------------------------------------------------------------------


def test_true_and_predicted_rotations(small_library: Library) -> None:
    turned = Label(Path("a.png"), "car", azimuth=80.0, elevation=5.0)
    assert true_rotation(turned, PHOTO, BOX, ()) == Rotation(80, 5)
    with pytest.raises(InputError, match=r"a\.png: has no labelled rotation, use --rotation predicted"):
        true_rotation(Label(Path("a.png"), "car", azimuth=80.0), PHOTO, BOX, ())

    class Unsure(FakeRotation):
        def estimate(self, *_: Any) -> list[RotationHypothesis]:
            return [RotationHypothesis(Rotation(1, 2), 1.0, 0.3, 60.0, True)]

    annotator = fake_annotator(small_library, rotation=Unsure())
    cads = small_library.models("car")
    assert predicted_rotation(annotator)(label(), PHOTO, BOX, cads) == Rotation(1, 2)
    with pytest.raises(RejectedError, match="flagged for review"):
        predicted_rotation(annotator, True)(label(), PHOTO, BOX, cads)
    sure = fake_annotator(small_library)
    assert predicted_rotation(sure, True)(label(), PHOTO, BOX, cads) == Rotation(35, 12)


def test_rotations_of_a_file(tmp_path: Path) -> None:
    angles = {"azimuth": 10, "elevation": 3}
    told = [
        {"photo": "a.png", "category": "car", **angles},
        {"photo": "b.png", "category": "car", "box": [0, 0, 9, 9], "azimuth": 20, "elevation": 3},
        {"photo": "b.png", "category": "car", "box": [0, 0, 30, 9.4], "azimuth": 30, "elevation": 3},
        {"photo": "c.png", "category": "car", "azimuth": 30},
    ]
    of = rotations_of_file(write(tmp_path, told, "turns.json"))

    def at(name: str, box: Box | None = None) -> float:
        # Another way to the same photo.
        photo = tmp_path / ".." / tmp_path.name / name
        return of(Label(photo, "car", box), PHOTO, BOX, ()).azimuth

    assert at("a.png") == 10 and at("a.png", Box(1, 1, 5, 5)) == 10
    assert at("b.png", Box(0, 0, 30, 9)) == 30 and at("b.png", Box(0, 0, 9, 9.5)) == 20
    for name in ("b.png", "c.png", "d.png"):
        with pytest.raises(InputError, match=rf"{name}: turns\.json has no rotation for it"):
            at(name)
    # Another object of the photo, though the file names no other.
    one = rotations_of_file(write(tmp_path, [told[1]], "one.json"))
    assert one(Label(tmp_path / "b.png", "car", Box(0, 0, 9, 9)), PHOTO, BOX, ()).azimuth == 20
    for other in (
        Label(tmp_path / "b.png", "car", Box(20, 0, 29, 9)),
        Label(tmp_path / "b.png", "car"),
        Label(tmp_path / "b.png", "chair", Box(0, 0, 9, 9)),
    ):
        with pytest.raises(InputError, match=r"b\.png: one\.json has no rotation for it"):
            one(other, PHOTO, BOX, ())
    with pytest.raises(InputError, match=r"none\.json: cannot be read"):
        rotations_of_file(tmp_path / "none.json")
