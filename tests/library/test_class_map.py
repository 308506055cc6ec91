from __future__ import annotations

import pytest

from cadpose.library.class_map import (
    CATEGORIES,
    PAPER_CATEGORIES,
    category_from_coco,
    category_from_name,
    category_from_sweethome3d,
    category_from_synset,
)


def test_every_name_means_one_category() -> None:
    synsets = [s for c in CATEGORIES.values() for s in c.synsets]
    coco = [n for c in CATEGORIES.values() for n in c.coco]
    assert len(set(synsets)) == len(synsets)
    assert len(set(coco)) == len(coco)
    assert all(len(s) == 8 and s.isdigit() for s in synsets)
    for category in CATEGORIES.values():
        assert all(category_from_coco(n) == category.name for n in category.coco)
        assert all(category_from_synset(s) == category.name for s in category.synsets)


def test_the_papers_ten_classes_can_be_detected_and_retrieved() -> None:
    assert set(PAPER_CATEGORIES) == {
        "bed", "motorbike", "table", "oven", "bag", "clock", "bottle", "chair", "car", "bench",
    }  # fmt: skip
    for name in PAPER_CATEGORIES:
        assert CATEGORIES[name].coco
        assert CATEGORIES[name].synsets


@pytest.mark.parametrize(
    ("coco", "category"),
    [
        ("dining table", "table"), ("handbag", "bag"), ("backpack", "bag"), ("suitcase", "bag"),
        ("couch", "sofa"), ("motorcycle", "motorbike"), ("refrigerator", "fridge"), ("TV", "tv"),
        ("potted plant", "plant"), ("zebra", None), ("traffic light", None),
    ],
)  # fmt: skip
def test_coco(coco: str, category: str | None) -> None:
    assert category_from_coco(coco) == category


@pytest.mark.parametrize(
    ("text", "category"),
    [
        ("Chairs", "chair"), ("couches", "sofa"), ("n02958343", "car"), ("desk", "table"),
        ("shelves", "bookcase"), ("wine-glass", "glass"), ("potted_plant", "plant"), ("nonsense", None),
    ],
)  # fmt: skip
def test_names_that_people_write(text: str, category: str | None) -> None:
    assert category_from_name(text) == category


@pytest.mark.parametrize(
    ("where", "name", "path", "category"),
    [
        ("Miscellaneous", "Table fan", "x/tableFan/tableFan.obj", "fan"),
        ("Lights", "Desk lamp", "x/desklamp/desklamp.obj", "lamp"),
        ("Living room", "TV remote control", "x/tv-remote-control/a.obj", "remote"),
        ("Living room", "TV stand", "x/tvStand/tvStand.obj", "cabinet"),
        ("Miscellaneous", "Table tennis bat", "x/tableTennisBat/a.obj", "other"),
        ("Kitchen", "Cup cake", "x/cupcake/cupcake.obj", "other"),
        ("Exterior", "Motorbike", "x/motorbike/motorbike.obj", "other"),
        ("Vehicles", "Yamaha YZR R6", "x/yamaha/yamaha.obj", "motorbike"),
        ("Bedroom", "Car model", "x/carrito/carrito.obj", "other"),
        ("Bathroom", "Toilet brush", "x/toiletBrush/a.obj", "other"),
        ("Bathroom", "Toilets unit", "x/toiletsUnit/a.obj", "toilet"),
        ("Kitchen", "Glass door cabinet", "x/a/a.obj", "cabinet"),
        ("Living room", "Glass table", "x/a/a.obj", "table"),
        ("Kitchen", "Glass", "x/a/a.obj", "glass"),
        ("Characters", "Sitting girl", "x/girlSittingTable/a.obj", "person"),
        ("Characters", "Bulldog", "x/bulldog/bulldog.obj", "dog"),
        ("Office", "Chair", "x/a/a.obj", "chair"),
        ("Bedroom", "Opened convertible sofa BZ", "x/a/a.obj", "bed"),
        ("Living room", "Ficus", "x/ficus/ficus.obj", "plant"),
        ("Exterior", "Ficus", "x/ficusTree/a.obj", "tree"),
    ],
)
def test_sweet_home_names(where: str, name: str, path: str, category: str) -> None:
    assert category_from_sweethome3d(where, name, path) == category
