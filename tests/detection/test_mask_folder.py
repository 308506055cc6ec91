from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.detection import DetectionSource, mask_folder, reading
from cadpose.detection.mask_folder import MaskFolder
from cadpose.errors import InputError
from cadpose.photos import read_photo
from cadpose.records import Photo

PHOTO = Photo(rgb=np.zeros((40, 60, 3), np.uint8), name="holiday/img_1.jpg")


def masks(folder: Path, *names: str, values: tuple[int, ...] = (255,)) -> Path:
    """A mask of as many squares as there are values under each name."""
    for name in names:
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        pixels = np.zeros((40, 60), np.uint8)
        for i, value in enumerate(values):
            pixels[5:15, 5 + 15 * i : 15 + 15 * i] = value
        Image.fromarray(pixels).save(path)
    return folder


def test_boxes_come_from_the_masks(tmp_path: Path) -> None:
    made: DetectionSource = MaskFolder(masks(tmp_path, "img_1.chair.png", values=(1, 2)))
    found = made.detect(PHOTO)
    assert [d.box.to_tuple() for d in found] == [(5, 5, 15, 15), (20, 5, 30, 15)]
    assert all(d.category == "chair" and d.source == "file" and d.score == 1.0 for d in found)
    assert found[0].mask is not None and found[0].mask.sum() == 100


@pytest.mark.parametrize(
    ("name", "categories"),
    [
        ("img_1.couch.png", []),
        ("img_1.jpg.couch.png", []),
        ("img_1.couch.2.png", []),
        ("couch/img_1.png", []),
        ("couch/img_1.3.png", []),
        ("couch/img_1.jpg.png", []),
        ("bed/img_1.couch.png", []),
        ("img_1.png", ["sofa"]),
        ("img_1.PNG", ["sofa"]),
        ("img_1.jpg.png", ["sofa"]),
        ("img_1.7.png", ["sofa"]),
    ],
)
def test_where_the_category_is_told(tmp_path: Path, name: str, categories: list[str]) -> None:
    made = MaskFolder(masks(tmp_path, name), categories or None)
    assert [d.category for d in made.detect(PHOTO)] == ["sofa"]
    assert made.knows("img_1.jpg") and made.knows("x/img_1.jpg") and not made.knows("img_2.jpg")


def test_several_files_of_a_photo_and_those_of_others(tmp_path: Path) -> None:
    folder = masks(tmp_path, "img_1.chair.1.png", "img_1.chair.2.png", "bed/img_1.png", "img_10.chair.png")
    assert [d.category for d in MaskFolder(folder).detect(PHOTO)] == ["bed", "chair", "chair"]
    assert [d.category for d in MaskFolder(folder, ["bed"]).detect(PHOTO)] == ["bed"]
    assert MaskFolder(folder).detect(Photo(rgb=PHOTO.rgb, name="other.jpg")) == []


def test_a_photo_whose_name_has_dots(tmp_path: Path) -> None:
    made = MaskFolder(masks(tmp_path, "img.v2.chair.png"))
    assert [d.category for d in made.detect(Photo(rgb=PHOTO.rgb, name="img.v2.jpg"))] == ["chair"]
    assert made.detect(Photo(rgb=PHOTO.rgb, name="img.jpg")) == []


def test_folders_that_are_no_category_are_the_photos(tmp_path: Path) -> None:
    made = MaskFolder(masks(tmp_path, "a/img_1.chair.png", "b/img_1.bed.png"))

    def seen(name: str) -> list[str]:
        return [d.category for d in made.detect(Photo(rgb=PHOTO.rgb, name=name))]

    assert seen("photos/a/img_1.jpg") == ["chair"] and seen("photos\\b\\img_1.jpg") == ["bed"]
    assert seen("photos/c/img_1.jpg") == [] and not made.knows("photos/c/img_1.jpg")
    with pytest.raises(InputError, match="several folders, a, b"):
        seen("img_1.jpg")
    only = MaskFolder(masks(tmp_path / "one", "a/img_1.bed.png"))
    assert [d.category for d in only.detect(Photo(rgb=PHOTO.rgb, name="img_1.jpg"))] == ["bed"]


def test_words_that_are_no_category_are_the_names(tmp_path: Path) -> None:
    folder = masks(tmp_path, "img_1.left.png", "gadget/img_1.png")
    made = MaskFolder(folder, ["bed"])
    assert not made.knows("x/img_1.jpg") and made.knows("img_1.left.jpg")
    (found,) = made.detect(Photo(rgb=PHOTO.rgb, name="x/img_1.left.jpg"))
    assert found.category == "bed"
    # A class that the library lacks counts where it is asked for.
    assert [d.category for d in MaskFolder(folder, ["gadget"]).detect(PHOTO)] == ["gadget"]


def test_too_many_masks_in_all_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(reading, "MAX_MASK_BYTES", 3 * 60 * 40)
    made = MaskFolder(masks(tmp_path, "img_1.bed.1.png", "img_1.bed.2.png", values=(1, 2)))
    with pytest.raises(InputError, match=r"bed\.2\.png has 2 masks of .* besides 2 from .* no more than 3"):
        made.detect(PHOTO)


def test_people_are_left_out_unless_asked_for(tmp_path: Path) -> None:
    folder = masks(tmp_path, "img_1.person.png", "img_1.chair.png")
    assert [d.category for d in MaskFolder(folder).detect(PHOTO)] == ["chair"]
    assert [d.category for d in MaskFolder(folder, ["person"]).detect(PHOTO)] == ["person"]


def test_which_of_several_categories(tmp_path: Path) -> None:
    made = MaskFolder(masks(tmp_path, "img_1.png"), ["bed", "chair"])
    with pytest.raises(InputError, match=r"img_1\.png does not tell which of bed, chair"):
        made.detect(PHOTO)


def test_without_a_category_lite0_names_the_mask(bench: Path, tmp_path: Path) -> None:
    photo = read_photo(bench / "photos" / "n04099969_rocking_chair.JPEG")
    pixels = np.zeros((photo.height, photo.width), np.uint8)
    pixels[5:-5, 5:-5] = 1
    Image.fromarray(pixels).save(tmp_path / "n04099969_rocking_chair.png")
    (found,) = MaskFolder(tmp_path).detect(photo)
    assert found.category == "chair" and len(found.alternatives) == 3


def test_folders_that_cannot_be_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "notes.txt").write_text("none")
    with pytest.raises(InputError, match="holds no PNG"):
        MaskFolder(tmp_path)
    monkeypatch.setattr(mask_folder, "MAX_FILES", 1)
    with pytest.raises(InputError, match="more than 1 files"):
        MaskFolder(masks(tmp_path, "img_1.png"))
