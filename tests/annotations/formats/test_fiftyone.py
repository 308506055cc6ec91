"""FiftyOne's folder: its JSON, masks and scenes, read as FiftyOne reads them."""

from __future__ import annotations

import base64
import io
import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import ExifTags, Image

from cadpose.annotations.formats.fiftyone_schema import dataset_document
from cadpose.annotations.formats.pictures import copy_photo
from cadpose.annotations.formats.registry import documents_from
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.scenes.turns import quaternion
from cadpose.errors import InputError
from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.frames import FloatArray, R_cv_from_gl
from cadpose.photos import read_photo
from cadpose.rle import decode_mask
from tests.annotations.formats import bop_toolkit
from tests.annotations.formats.made import Made


@pytest.fixture(scope="module")
def kept(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Not to be changed."""
    return made.export("fiftyone", tmp_path_factory.mktemp("fiftyone") / "set")


@pytest.fixture
def folder(made: Made, tmp_path: Path) -> Path:
    return made.export("fiftyone", tmp_path / "set")


def samples(folder: Path) -> Any:
    return json.loads((folder / "samples.json").read_text())["samples"]


def stored_array(told: Any) -> Any:
    """As fiftyone.core.utils.deserialize_numpy_array reads it."""
    return np.load(io.BytesIO(zlib.decompress(base64.b64decode(told["$binary"]["base64"]))))


def turn(q: list[float]) -> FloatArray:
    """The rotation of a quaternion x, y, z, w, as three.js builds it."""
    x, y, z, w = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_samples(made: Made, kept: Path) -> None:
    told = samples(kept)
    assert len(told) == len(made.documents) == 4
    assert len({s["_id"]["$oid"] for s in told}) == 4
    for sample, document in zip(told, made.documents, strict=True):
        photo = read_photo(kept / sample["filepath"])
        assert photo.sha256 == document.photo.sha256
        assert [sample["metadata"][k] for k in ("width", "height")] == list(document.photo.size)
        width, height = document.photo.size
        for found, part in zip(sample["annotations"]["detections"], document.annotations, strict=True):
            x, y, w, h = np.array(found["bounding_box"]) * [width, height, width, height]
            assert (x, y, x + w, y + h) == pytest.approx(part.detection.box)
            assert (found["label"], found["confidence"]) == (part.detection.category, part.detection.score)
            assert ("mask" in found) == (part.detection.mask is not None)
            assert (kept / found["scene"]).is_file()
            if part.detection.mask is not None:
                mask = decode_mask(part.detection.mask.size, part.detection.mask.counts)
                own = stored_array(found["mask"])
                top, left = (int(np.floor(v + 0.5 - 1e-6)) for v in (y, x))
                np.testing.assert_array_equal(own, mask[top : top + len(own), left : left + own.shape[1]])


def test_every_key_of_a_sample_is_a_field(kept: Path) -> None:
    for folder, media, field in ((kept, "image", "annotations"), (kept / "scenes", "3d", None)):
        described = json.loads((folder / "metadata.json").read_text())
        assert described == dataset_document(media, field)
        fields = {f["db_field"]: f for f in described["sample_fields"]}
        for sample in samples(folder):
            assert {k for k in sample if k not in ("_media_type", "_rand")} <= set(fields)
            assert sample["_media_type"] == media
        if field:
            own = {f["db_field"] for f in fields[field]["fields"][0]["fields"]}
            for found in samples(folder)[0][field]["detections"]:
                assert set(found) - {"_cls", "attributes"} <= own


def test_the_scenes_camera_sees_what_the_annotation_says(made: Made, kept: Path) -> None:
    parts = [part for document in made.documents for part in document.annotations]
    told = samples(kept / "scenes")
    assert len(told) == len(parts)
    for sample, part in zip(told, parts, strict=True):
        path = kept / "scenes" / sample["filepath"]
        scene = json.loads(path.read_text())
        (model,) = scene["children"]
        mesh = bop_toolkit.load_ply(path.parent / model["plyPath"])
        world = mesh["pts"] @ turn(model["quaternion"]).T + model["position"]
        assert scene["camera"]["position"] == [0.0, 0.0, 0.0] and scene["camera"]["up"] == "Y"
        x, y, z = (world @ R_cv_from_gl.T).T
        height = scene["camera"]["aspect"] and next(
            d.photo.size[1] for d in made.documents if d.photo.name == sample["photo_name"]
        )
        focal = height / 2 / np.tan(np.deg2rad(scene["camera"]["fov"]) / 2)
        pixels = focal * np.stack([x, y], axis=1) / z[:, None] + part.pose.principal_px
        np.testing.assert_allclose(pixels, part.pose.pose().project(mesh["pts"]), atol=1e-6)


@given(st.floats(0, 360), st.floats(-90, 90), st.floats(-180, 180))
def test_quaternions_are_their_rotations(azimuth: float, elevation: float, inplane: float) -> None:
    R = rotation_from_angles(azimuth, elevation, inplane)
    np.testing.assert_allclose(turn(quaternion(R)), R, atol=1e-12)


def edited(folder: Path, edit: Any) -> Any:
    file = folder / "samples.json"
    told = json.loads(file.read_text())
    edit(told["samples"][1]["annotations"]["detections"])
    file.write_text(json.dumps(told))
    return list(documents_from("fiftyone", folder))[1].annotations


def test_what_was_changed_counts(made: Made, folder: Path) -> None:
    before = made.documents[1].annotations[0]

    def edit(found: Any) -> None:
        out = io.BytesIO()
        np.save(out, np.ones((39, 50), np.uint8))
        found[0]["mask"]["$binary"]["base64"] = base64.b64encode(zlib.compress(out.getvalue())).decode()
        found[0]["label"] = "sofa"

    (part,) = edited(folder, edit)
    assert part.detection.category == "sofa" and part.pose == before.pose
    mask = decode_mask(part.detection.mask.size, part.detection.mask.counts)
    # The blot beyond the box is gone with the old mask.
    assert mask.sum() == 50 * 39 and mask[2:41, 1:51].all()
    assert edited(folder, lambda found: found.clear()) == ()


def test_a_box_that_was_moved(folder: Path) -> None:
    (part,) = edited(folder, lambda found: found[0].update(bounding_box=[0.0, 0.0, 0.5, 0.5], mask=None))
    assert part.detection.box == (0.0, 0.0, 45.0, 30.5) and part.detection.mask is None


def bomb() -> dict[str, Any]:
    data = base64.b64encode(zlib.compress(b"\0" * 200_000_000, 9)).decode()
    return {"$binary": {"base64": data, "subType": "00"}}


def pickled() -> dict[str, Any]:
    out = io.BytesIO()
    np.save(out, np.array([[{}]]), allow_pickle=True)
    data = base64.b64encode(zlib.compress(out.getvalue())).decode()
    return {"$binary": {"base64": data, "subType": "00"}}


@pytest.mark.parametrize(
    ("edit", "words"),
    [
        (lambda f: f[0].pop("cadpose"), "lacks the field cadpose"),
        (lambda f: f[0].update(cadpose="{"), "lacks the field cadpose"),
        (lambda f: f[0].update(bounding_box=[0, 0, 0, 0]), "empty"),
        (lambda f: f[0].update(bounding_box=[0, 0]), "unusable"),
        (lambda f: f[0].update(mask={"$binary": {"base64": "!"}}), "unusable"),
        (lambda f: f[0].update(mask=bomb()), "more than 100000000 pixels"),
        (lambda f: f[0].update(mask=pickled()), "unusable"),
    ],
)
def test_mistakes_name_the_detection(folder: Path, edit: Any, words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        edited(folder, edit)
    assert str(caught.value).startswith(f"{folder / 'samples.json'}: sample 2, detection 1")


def test_photos_are_copied_upright(made: Made, tmp_path: Path) -> None:
    source = tmp_path / "photos"
    source.mkdir()
    picture = Image.new("RGB", (60, 20), (200, 10, 10))
    exif = Image.Exif()
    exif[ExifTags.Base.Orientation] = 6
    cases: tuple[tuple[str, dict[str, Any], str], ...] = (
        ("plain.jpg", {}, ".jpg"), ("turned.jpg", {"exif": exif}, ".png"), ("old.bmp", {}, ".png"),
    )  # fmt: skip
    for name, options, ending in cases:
        picture.save(source / name, **options)
        photo = read_photo(source / name)
        told = made.documents[3].photo.model_copy(
            update={"name": name, "sha256": photo.sha256, "size": (photo.width, photo.height)}
        )
        document = made.documents[3].model_copy(update={"photo": told})
        copy = copy_photo(Sources(photos=source), document, tmp_path)
        assert copy.suffix == ending
        np.testing.assert_array_equal(read_photo(copy).rgb, photo.rgb)
        assert (copy.read_bytes() == (source / name).read_bytes()) == (ending == ".jpg")
