from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.detection import Detector
from cadpose.detection.box_masks import BoxMasks
from cadpose.detection.coco import COCO_NAMES
from cadpose.detection.embedded import MOST, EmbeddedDetector
from cadpose.detection.imagenet import IMAGENET_INDICES
from cadpose.detection.ssd import RawBoxes
from cadpose.encoder import Lite0
from cadpose.geometry.boxes import Box, box_iou
from cadpose.geometry.frames import FloatArray
from cadpose.photos import read_photo
from cadpose.records import Photo

ID = {name: i for i, name in COCO_NAMES.items()}
PHOTO = Photo(rgb=np.full((400, 600, 3), 200, np.uint8))


class FakeLite0(Lite0):
    """Says of every crop with how much probability it shows which category; the rest is a goldfish."""

    def __init__(self, **shares: float) -> None:
        super().__init__()
        self.shares = shares
        self.looked_at = 0

    def logits(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        self.looked_at += len(images)
        p = np.full(1000, 1e-9)
        p[1] = 1.0 - sum(self.shares.values())
        for category, share in self.shares.items():
            p[IMAGENET_INDICES[category][0]] = share
        return np.tile(np.log(p).astype(np.float32), (len(images), 1))


class FakeSsd:
    def __init__(self, *rows: tuple[str, float, tuple[float, float, float, float]]) -> None:
        self.rows = rows

    def boxes(self, rgb: NDArray[np.uint8], *, floor: float, tiles: bool) -> RawBoxes:
        return RawBoxes(
            boxes=np.array([r[2] for r in self.rows], np.float64).reshape(-1, 4),
            classes=np.array([ID[r[0]] for r in self.rows], np.int64),
            scores=np.array([r[1] for r in self.rows], np.float64),
        )


def detector(
    *rows: tuple[str, float, tuple[float, float, float, float]],
    lite: FakeLite0 | None = None,
    categories: list[str] | None = None,
    propose: bool = False,
) -> EmbeddedDetector:
    made = EmbeddedDetector(categories, encoder=lite or FakeLite0(), propose=propose, masks=BoxMasks())
    made._ssd = FakeSsd(*rows)  # type: ignore[assignment]
    return made


LEFT = (20.0, 100.0, 220.0, 300.0)
RIGHT = (350.0, 100.0, 550.0, 300.0)


class TestFusion:
    def test_is_a_detector(self) -> None:
        made: Detector = EmbeddedDetector()
        assert made.name == "embedded"

    def test_the_ssd_alone_keeps_its_score(self) -> None:
        (found,) = detector(("car", 0.6, LEFT)).detect(PHOTO)
        assert (found.category, found.box.to_tuple(), found.source) == ("car", LEFT, "embedded")
        assert found.score == pytest.approx(0.6)

    def test_agreement_raises_the_score(self) -> None:
        (found,) = detector(("car", 0.4, LEFT), lite=FakeLite0(car=0.9)).detect(PHOTO)
        assert 0.4 < found.score < 1.0

    def test_lite0_renames_what_the_ssd_took_for_something_else(self) -> None:
        (found,) = detector(("umbrella", 0.89, LEFT), lite=FakeLite0(lamp=0.97)).detect(PHOTO)
        assert found.category == "lamp"
        assert dict(found.alternatives)["umbrella"] < found.score

    def test_a_weak_word_of_lite0_renames_nothing(self) -> None:
        (found,) = detector(("dining table", 0.8, LEFT), lite=FakeLite0(chair=0.4)).detect(PHOTO)
        assert found.category == "table"

    def test_what_is_boxed_within_names_nothing_around_it(self) -> None:
        table, bottle = (10.0, 80.0, 500.0, 390.0), (200.0, 100.0, 260.0, 300.0)
        rows = [("dining table", 0.85, table), ("bottle", 0.9, bottle)]
        found = detector(*rows, lite=FakeLite0(bottle=0.95)).detect(PHOTO)
        assert [(d.category, d.box.to_tuple()) for d in found] == [("bottle", bottle), ("table", table)]

    def test_people_animals_and_food_are_no_objects(self) -> None:
        rows = [(name, 0.95, LEFT) for name in ("person", "dog", "pizza")]
        assert detector(*rows).detect(PHOTO) == []

    def test_one_place_gives_one_object(self) -> None:
        near = (22.0, 98.0, 224.0, 303.0)
        found = detector(("chair", 0.7, LEFT), ("couch", 0.6, near), ("chair", 0.5, RIGHT)).detect(PHOTO)
        assert [(d.category, d.box.to_tuple()) for d in found] == [("chair", LEFT), ("chair", RIGHT)]
        assert dict(found[0].alternatives)["sofa"] == pytest.approx(0.6)

    def test_pickups_count_half_as_cars_and_wholly_where_lite0_agrees(self) -> None:
        rows = [("truck", 0.7, LEFT)]
        (found,) = detector(*rows, lite=FakeLite0(car=0.9)).detect(PHOTO)
        assert found.category == "car"
        assert detector(*rows).detect(PHOTO)[0].category == "truck"
        assert detector(*rows, lite=FakeLite0(car=0.3, truck=0.1)).detect(PHOTO)[0].category == "car"
        assert detector(*rows, lite=FakeLite0(car=0.1, truck=0.3)).detect(PHOTO)[0].category == "truck"

    def test_only_wanted_categories(self) -> None:
        rows = [("chair", 0.9, LEFT), ("clock", 0.8, RIGHT)]
        assert [d.category for d in detector(*rows, categories=["clock"]).detect(PHOTO)] == ["clock"]

    def test_faint_and_tiny_boxes_are_dropped(self) -> None:
        assert detector(("clock", 0.9, (10.0, 10.0, 16.0, 18.0)), ("car", 0.2, LEFT)).detect(PHOTO) == []

    def test_best_first_and_capped_looks(self) -> None:
        rows = [
            ("bottle", 0.3 + 0.01 * i, (20.0 * i, 10.0 + 5 * i, 20.0 * i + 19, 80.0 + 5 * i))
            for i in range(25)
        ]
        lite = FakeLite0()
        found = detector(*rows, lite=lite).detect(PHOTO)
        assert [d.score for d in found] == sorted((d.score for d in found), reverse=True)
        assert len(found) == MOST and lite.looked_at == MOST + 1


class TestUnboxed:
    def test_lite0_is_sure_and_nothing_was_boxed(self) -> None:
        (found,) = detector(lite=FakeLite0(cabinet=0.8)).detect(PHOTO)
        assert (found.category, found.box) == ("cabinet", Box(0, 0, 600, 400))
        assert found.score < 0.8

    def test_lite0_is_not_sure(self) -> None:
        assert detector(lite=FakeLite0(cabinet=0.25)).detect(PHOTO) == []

    def test_category_is_not_wanted_or_already_there(self) -> None:
        assert detector(lite=FakeLite0(cabinet=0.8), categories=["car"]).detect(PHOTO) == []
        large = (100.0, 50.0, 500.0, 350.0)  # what fills the photo has a name already
        found = detector(("umbrella", 0.9, large), lite=FakeLite0(cabinet=0.55)).detect(PHOTO)
        assert [d.category for d in found] == ["umbrella"]
        found = detector(("clock", 0.9, LEFT), lite=FakeLite0(clock=0.8)).detect(PHOTO)
        assert [d.box.to_tuple() for d in found] == [LEFT]

    def test_the_place_is_where_lite0_knows_it(self) -> None:
        rgb = np.full((400, 600, 3), 200, np.uint8)
        rgb[50:150, 400:500] = 0
        photo = Photo(rgb)
        (found,) = detector(lite=SeesBlack("cabinet")).detect(photo)
        assert found.category == "cabinet"
        assert found.box.x0 <= 410 and found.box.y0 <= 60 and found.box.x1 >= 490 and found.box.y1 >= 140
        assert found.box.area < 0.25 * 600 * 400
        near = (395.0, 45.0, 520.0, 170.0)
        (found,) = detector(("clock", 0.05, near), lite=SeesBlack("cabinet")).detect(photo)
        assert found.category == "cabinet"

    def test_the_place_is_narrowed_to_what_is_seen_in_it(self) -> None:
        class Corner:
            name = "corner"

            def mask(self, photo: Photo, box: Box) -> NDArray[np.bool_]:
                out = np.zeros((photo.height, photo.width), np.bool_)
                out[100:300, 200:500] = True
                return out

        made = detector(lite=FakeLite0(cabinet=0.8))
        made.masks = Corner()
        (found,) = made.detect(PHOTO)
        assert found.box == Box(200, 100, 500, 300)

    def test_a_long_photo_takes_no_more_looks(self) -> None:
        lite = FakeLite0(cabinet=0.8)
        photo = Photo(np.full((60, 6000, 3), 200, np.uint8))
        assert len(detector(lite=lite).detect(photo)) == 1
        assert lite.looked_at < 300

    def test_a_faint_word_of_the_ssd_gives_way(self) -> None:
        full = (0.0, 0.0, 600.0, 400.0)
        found = detector(("book", 0.4, full), lite=FakeLite0(bookcase=0.35)).detect(PHOTO)
        assert [d.category for d in found] == ["bookcase"]


class SeesBlack(FakeLite0):
    """Knows a category wherever some pixels are black."""

    def __init__(self, category: str) -> None:
        super().__init__()
        self.category = category

    def logits(self, images: NDArray[np.uint8]) -> NDArray[np.float32]:
        p = np.full((len(images), 1000), 1e-9)
        black = (images[..., 0] < 100).mean(axis=(1, 2))
        p[:, IMAGENET_INDICES[self.category][0]] = 0.05 + 0.9 * np.minimum(1.0, 12.0 * black)
        p[:, 1] = 1.0 - p.sum(axis=1)
        return np.asarray(np.log(p), np.float32)


class TestProposals:
    def test_what_stands_out_is_proposed_as_unsure(self) -> None:
        lite = FakeLite0(chair=0.1, sofa=0.08, bed=0.02)
        (found,) = detector(("dog", 0.1, RIGHT), ("kite", 0.1, LEFT), lite=lite, propose=True).detect(PHOTO)
        assert found.unsure
        assert found.box.to_tuple() == LEFT
        assert 0.0 < found.score < 0.3
        assert [found.category, *(c for c, _ in found.alternatives)] == ["chair", "sofa", "bed"]
        scores = [found.score, *(s for _, s in found.alternatives)]
        assert scores == sorted(scores, reverse=True)

    def test_the_whole_photo_where_nothing_was_boxed(self) -> None:
        (found,) = detector(lite=FakeLite0(chair=0.1), propose=True).detect(PHOTO)
        assert found.box == Box(0, 0, 600, 400)

    def test_nothing_where_lite0_knows_nothing_or_people_fill_the_photo(self) -> None:
        assert detector(propose=True).detect(PHOTO) == []
        large = (50.0, 50.0, 450.0, 380.0)
        lite = FakeLite0(chair=0.1)
        assert detector(("person", 0.9, large), lite=lite, propose=True).detect(PHOTO) == []

    def test_a_sure_object_leaves_no_proposal(self) -> None:
        (found,) = detector(("chair", 0.9, LEFT), propose=True).detect(PHOTO)
        assert not found.unsure

    def test_asking_for_faint_ones_adds_them_and_changes_nothing_else(self) -> None:
        rows = [("clock", 0.15, (300.0, 20.0, 560.0, 380.0))]
        lite = FakeLite0(cabinet=0.4)
        made, faint = detector(*rows, lite=lite), detector(*rows, lite=lite)
        faint.min_score = 0.05
        usual, asked = (
            {(d.category, d.box.to_tuple(), d.score) for d in one.detect(PHOTO)} for one in (made, faint)
        )
        assert usual and usual < asked
        rows = [("clock", 0.6, RIGHT)]
        strict = detector(*rows, propose=True)
        strict.min_score = 0.9
        assert len(detector(*rows).detect(PHOTO)) == 1 and strict.detect(PHOTO) == []


class TestRealPhotos:
    """The installed network through the installed OpenCV, on photos that leave no doubt."""

    @pytest.mark.parametrize(
        ("name", "category", "box"),
        [
            ("n03100240_convertible.JPEG", "car", (23, 112, 492, 335)),
            ("n04070727_refrigerator.JPEG", "fridge", (100, 25, 298, 488)),
            ("n04380533_table_lamp.JPEG", "lamp", None),
            ("n03063599_coffee_mug.JPEG", "cup", (250, 285, 645, 675)),
        ],
    )
    def test_object_is_found(
        self, bench: Path, name: str, category: str, box: tuple[float, ...] | None
    ) -> None:
        found = [
            d
            for d in EmbeddedDetector().detect(read_photo(bench / "photos" / name))
            if d.category == category
        ]
        assert found and found[0].score > 0.5
        if box:
            assert iou(found[0].box, box) > 0.75

    def test_tiles_find_more_bottles_and_the_answer_is_the_same_again(self, bench: Path) -> None:
        photo = read_photo(bench / "photos" / "n02823428_beer_bottle.JPEG")
        one, two = (EmbeddedDetector(["bottle"], tiles=False).detect(photo) for _ in range(2))
        assert len(one) >= 4
        assert [(d.box, d.score) for d in one] == [(d.box, d.score) for d in two]


def iou(box: Box, other: tuple[float, ...]) -> float:
    a: FloatArray = np.array(box.to_tuple())
    return float(box_iou(a, np.array(other)))


def test_every_category_exists_and_no_index_stands_twice() -> None:
    from cadpose.library.class_map import CATEGORIES

    assert set(IMAGENET_INDICES) <= set(CATEGORIES)
    indices = [i for group in IMAGENET_INDICES.values() for i in group]
    assert len(indices) == len(set(indices)) and min(indices) >= 0 and max(indices) < 1000


def test_lite0_names_the_photos_as_their_files_do(bench: Path) -> None:
    """The indices are the usual ones: the network says of the photo of a mug that it shows a cup."""
    from cadpose.detection.imagenet import category_probabilities
    from cadpose.encoder import lite0
    from cadpose.photos import crop_square

    names = {
        "n03063599_coffee_mug": "cup",
        "n04447861_toilet_seat": "toilet",
        "n04099969_rocking_chair": "chair",
        "n03761084_microwave": "microwave",
        "n02930766_cab": "car",
        "n04380533_table_lamp": "lamp",
        "n02870880_bookcase": "bookcase",
        "n03196217_digital_clock": "clock",
        "n04026417_purse": "bag",
        "n03125729_cradle": "bed",
        "n03983396_pop_bottle": "bottle",
        "n03785016_moped": "motorbike",
        "n03016953_chiffonier": "cabinet",
    }
    for name, category in names.items():
        photo = read_photo(bench / "photos" / f"{name}.JPEG")
        crop = crop_square(photo.rgb, Box(0, 0, photo.width, photo.height))
        probabilities = category_probabilities(lite0().logits(crop[None]))[0]
        assert max(probabilities, key=probabilities.__getitem__) == category
        assert probabilities[category] > 0.6
