from __future__ import annotations

from pathlib import Path

import pytest

from cadpose.datasets.dataset import category_of, rotation_of
from cadpose.datasets.labels import Label, write_labels
from cadpose.datasets.registry import KINDS, open_dataset
from cadpose.errors import InputError
from cadpose.library.class_map import CATEGORIES
from tests.datasets.trees import bop_tree, imagenet3d_tree, objectnet3d_tree, pascal3d_tree, pix3d_tree

TREES = {
    "pascal3d": pascal3d_tree, "objectnet3d": objectnet3d_tree, "pix3d": pix3d_tree,
    "imagenet3d": imagenet3d_tree, "bop": bop_tree,
}  # fmt: skip


@pytest.mark.parametrize("kind", TREES)
def test_every_kind_opens_and_counts_its_parts(tmp_path: Path, kind: str) -> None:
    dataset = open_dataset(kind, TREES[kind](tmp_path))
    steps: list[None] = []
    labels = list(dataset.labels(on_part=lambda: steps.append(None)))
    assert len(steps) == len(dataset) > 0
    assert labels == list(dataset) and {label.source for label in labels} == {kind} == {dataset.kind}
    assert all(label.photo.is_file() for label in labels)
    write_labels(tmp_path / "out.jsonl", labels)
    assert list(open_dataset("labels", tmp_path / "out.jsonl")) == labels


def test_a_label_file_is_a_data_set(tmp_path: Path) -> None:
    file = tmp_path / "l.jsonl"
    made = [
        Label(tmp_path / "a.png", "car", split=split, occluded=occluded, difficult=difficult)
        for split in ("train", "val")
        for occluded, difficult in ((False, False), (True, False), (False, True))
    ]
    write_labels(file, made)
    assert list(open_dataset("labels", file)) == made
    assert list(open_dataset("labels", file, "val")) == made[3:]
    assert list(open_dataset("labels", file, published=True)) == [*made[:2], made[3]]


def test_a_kind_that_is_not_there(tmp_path: Path) -> None:
    assert set(KINDS) == {*TREES, "labels"}
    with pytest.raises(InputError, match="no data set 'coco': choose pascal3d, objectnet3d"):
        open_dataset("coco", tmp_path)
    for kind in KINDS:
        with pytest.raises(InputError, match=str(tmp_path)):
            open_dataset(kind, tmp_path)


def test_the_classes_of_pascal3d_are_library_categories() -> None:
    from cadpose.datasets.pascal3d import CLASSES

    assert {category_of(name) for name in CLASSES} <= set(CATEGORIES)
    assert (category_of("diningtable"), category_of("aeroplane"), category_of("ashtray")) == (
        "table",
        "airplane",
        "ashtray",
    )


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 1e12])
def test_an_elevation_that_is_no_angle(wrong: float) -> None:
    with pytest.raises(ValueError, match="is no angle"):
        rotation_of(0.0, wrong, 0.0)
