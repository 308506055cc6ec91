"""``cadpose detect``, and what ``annotate`` takes in a detector's place."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.records import Detection, Photo, Rotation
from cadpose.rle import decode_mask, runs_from_text
from tests.cli.invoking import cadpose, given, said
from tests.small_library import Shot, save, shoot


@pytest.fixture(scope="module")
def hatch(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", Rotation(35, 12, 4))


@pytest.fixture
def photo(hatch: Shot, tmp_path: Path) -> Path:
    return save(tmp_path / "photos" / "street.png", hatch.photo.rgb)


def test_detect_draws_over_no_photo(tmp_path: Path) -> None:
    for name in ("car.png", "car.detections.png"):
        Image.new("RGB", (64, 48)).save(tmp_path / name)
    before = (tmp_path / "car.detections.png").read_bytes()
    (tmp_path / "link").symlink_to(tmp_path)
    result = cadpose("detect", tmp_path, "--out", tmp_path / "link")
    assert result.exit_code == 1 and "car.detections.png is one of the photos" in result.stderr
    assert (tmp_path / "car.detections.png").read_bytes() == before


def test_detect_draws_boxes(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "new" / "boxes"
    result = cadpose("detect", photo, "--out", out, "--json")
    assert said(result)[0]["photo"] == str(photo)
    assert {p.name for p in out.iterdir()} == {"street.detections.png", "index.html"}
    Image.open(out / "street.detections.png").load()


class Certain:
    """Knows of one object in every photo."""

    name = "certain"

    def detect(self, photo: Photo) -> list[Detection]:
        others = (("sofa", 0.3), ("bed", 0.2))
        return [Detection(Box(0, 20, 100, 90), "chair", 0.4567, unsure=True, alternatives=others)]


def test_detect_tells_all_and_writes_what_annotate_reads(
    photo: Path, small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cadpose.backends.make_detector", lambda *_: Certain())
    coco = tmp_path / "found" / "all.json"
    (told,) = said(cadpose("detect", photo, "--json", "--coco", coco))
    (found,) = told["detections"]
    mask = found.pop("mask")
    assert found == {
        "category": "chair",
        "score": 0.4567,
        "box": [0, 20, 100, 90],
        "alternatives": [{"category": "sofa", "score": 0.3}, {"category": "bed", "score": 0.2}],
        "truncated": True,
        "tiny": False,
        "unsure": True,
    }
    with Image.open(photo) as image:
        assert mask["size"] == [image.height, image.width]
    pixels = decode_mask(mask["size"], runs_from_text(mask["counts"]))
    assert pixels[25:85, 5:95].any() and not pixels[:, 101:].any() and not pixels[:19].any()
    (told,) = said(cadpose("detect", photo, "--json", "--masks", "none"))
    assert told["detections"][0]["mask"] is None
    result = cadpose("detect", photo)
    assert "unsure: chair / sofa / bed" in result.stdout and "truncated unsure" in result.stdout

    common = ["--library", small_library.path, "--out", tmp_path / "out", "--detections", coco]
    (told,) = said(cadpose("annotate", photo, *common, "--json"))
    (part,) = told["annotations"]
    assert part["category"] == "chair" and (part["truncated"], part["tiny"], part["unsure"]) == (1, 0, 1)
    document = json.loads((tmp_path / "out" / "street.json").read_text())
    runs = document["annotations"][0]["detection"]["mask"]["counts"]
    assert runs == runs_from_text(mask["counts"])
    result = cadpose("annotate", photo, *common, "--resume")
    assert "unsure: chair / sofa / bed" in result.stdout and "truncated unsure" in result.stdout


def test_an_object_called_failed_is_no_failure(
    photo: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = [Detection(Box(0, 0, 40, 40), "failed")]
    monkeypatch.setattr(Certain, "detect", lambda *_: found)
    monkeypatch.setattr("cadpose.backends.make_detector", lambda *_: Certain())
    assert cadpose("detect", photo).exit_code == 0
    (tmp_path / "none.png").write_bytes(b"no photo")
    result = cadpose("detect", tmp_path / "none.png", "--out", tmp_path / "out")
    assert result.exit_code == 1 and "Pictures" not in result.stdout, "there is no page to look at"


def test_detect_refuses_a_category_that_no_detector_knows(tmp_path: Path) -> None:
    result = cadpose("detect", str(tmp_path), "--category", "zebra")
    assert result.exit_code == 2
    assert "zebra" in result.stderr


def test_a_network_of_ones_own_has_classes_of_its_own(photo: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def made(*given: object) -> Certain:
        asked.append(given)
        return Certain()

    monkeypatch.setattr("cadpose.backends.make_detector", made)
    said(cadpose("detect", photo, "--detector", "onnx:own.json", "--category", "crane", "--json"))
    assert asked == [("onnx:own.json", ["crane"], "cpu")]


def test_annotate_with_coco_detections(
    small_library: Library, photo: Path, hatch: Shot, tmp_path: Path
) -> None:
    file = tmp_path / "boxes.json"
    r = hatch.rotation
    annotation = {"image_id": 1, "category_id": 3, "bbox": list(hatch.box.to_xywh()), "score": 0.5}
    turned = annotation | {"azimuth": r.azimuth, "elevation": r.elevation, "inplane": r.inplane}
    file.write_text(
        json.dumps(
            {
                "images": [{"id": 1, "file_name": "street.png"}],
                "categories": [{"id": i, "name": n} for i, n in ((3, "car"), (4, "gadget"), (5, "person"))],
                "annotations": [turned, annotation | {"category_id": 4}, annotation | {"category_id": 5}],
            }
        )
    )
    arguments = ["annotate", photo, "--library", small_library.path, "--out", tmp_path / "o", "--json"]
    result = cadpose(*arguments, "--detections", file)
    (told,) = said(result)
    assert [a["cad"] for a in told["annotations"]] == ["made/car/hatch.obj"]
    assert [f["category"] for f in told["failures"]] == ["gadget"], "people are not even tried"
    assert result.exit_code == 1 and result.stderr.startswith(f"cadpose: {photo}: gadget left out: ")
    # Only what is asked for.
    result = cadpose(*arguments, "--detections", file, "--category", "cars")
    assert result.exit_code == 0 and said(result)[0]["failures"] == []


def test_a_photo_that_the_detections_do_not_name_is_told(
    small_library: Library, photo: Path, tmp_path: Path
) -> None:
    file = tmp_path / "boxes.json"
    common = [photo, "--library", small_library.path, "--out", tmp_path / "o", "--detections", file]
    for name, says, other in (
        ("other.png", "the file does not name it", "no object found"),
        ("street.png", "no object found", "does not name it"),
    ):
        images = [{"id": 1, "file_name": name}]
        file.write_text(json.dumps({"images": images, "categories": [], "annotations": []}))
        result = cadpose("annotate", *common)
        assert result.exit_code == 0 and says in result.stdout and other not in result.stdout
        (told,) = said(cadpose("annotate", *common, "--json"))
        assert told["named"] == (name == "street.png") and told["annotations"] == []


def test_annotate_with_a_polygon_and_with_masks(
    small_library: Library, photo: Path, hatch: Shot, tmp_path: Path
) -> None:
    common = ["--library", small_library.path, "--out", tmp_path / "out", *given(hatch)[2:], "--json"]
    b = hatch.box
    outline = f"{b.x0},{b.y0} {b.x1},{b.y0} {b.x1},{b.y1} {b.x0},{b.y1}"
    save(tmp_path / "masks" / "street.car.png", np.repeat(hatch.mask[..., None] * np.uint8(255), 3, axis=2))
    mask = tmp_path / "masks" / "street.car.png"
    for objects in (["--polygon", outline], ["--mask", mask]):
        (told,) = said(cadpose("annotate", photo, *common, *objects))
        (found,) = told["annotations"]
        assert found["cad"] == "made/car/hatch.obj" and not found["truncated"] and found["alternatives"] == []
        assert found["box"] == pytest.approx(b.to_tuple(), abs=1.0)
    assert found["mask_iou"] > 0.9, "the true mask"
    (told,) = said(cadpose("annotate", photo, *common[:4], "--json", "--detections", tmp_path / "masks"))
    assert [a["category"] for a in told["annotations"]] == ["car"] and told["named"]
    result = cadpose("annotate", photo, mask, *common, "--mask", mask)
    assert result.exit_code == 2 and "belong to one photo, 2" in re.sub(r"[\s│]+", " ", result.stderr)
    Image.new("L", (hatch.photo.width, hatch.photo.height)).save(tmp_path / "empty.png")
    result = cadpose("annotate", photo, *common, "--mask", tmp_path / "empty.png")
    assert result.exit_code == 1 and "empty.png shows no object" in result.stderr
