"""Another model in the object's place, from the page."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.document import document_from
from cadpose.geometry.camera import projected_rectangle
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation, Candidate, Detection, Pose4Dof, Rotation
from cadpose.replacement.replacer import Replacer
from cadpose.review.answers import ReplaceAnswer
from cadpose.review.shapes import PoseShape, RleShape
from tests.review.serving import Served, serve
from tests.small_library import save, shoot

TURN = Rotation(35.0, 12.0, 0.0)


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory, small_library: Library) -> Iterator[Served]:
    """One photo with one car, and the same again without a mask."""
    folder = tmp_path_factory.mktemp("replace")
    shot = shoot(small_library, "made/car/hatch.obj", TURN)
    photo = read_photo(save(folder / "street.png", shot.photo.rgb))
    whole = Annotation(
        photo_name=photo.name,
        photo_sha256=photo.sha256,
        photo_size=(photo.width, photo.height),
        detection=Detection(shot.box, "car", mask=shot.mask),
        pose=Pose4Dof(TURN, shot.focal_px, (210.0, 140.0)),
        candidates=(Candidate(shot.cad, 1.0, TURN),),
        hypotheses=(),
        box_iou=1.0,
    )
    served = serve(folder, small_library, photos=[folder])
    served.desk.store.add(document_from(photo, [whole]))
    yield served
    served.close()


def replaced(served: Served, status: int = 200, **changes: Any) -> Any:
    body = {"cad_id": "made/car/van.glb"} | changes
    return served.post(f"/api/annotations/{served.ids()[0]}/replace", body, status)


def test_a_van_for_a_hatchback(street: Served) -> None:
    assert street.get("/api/session")["actions"]["replace"]
    told = ReplaceAnswer.model_validate(replaced(street))
    answer = street.client.get(told.picture)
    assert answer.headers["content-type"] == "image/png" and "private" in answer.headers["cache-control"]
    picture = np.asarray(Image.open(io.BytesIO(answer.content)))
    (item,) = street.desk.store.queue().items
    photo = street.desk.photo(item.photo_sha256, item.photo_name)
    assert picture.shape == photo.rgb.shape
    changed = np.abs(picture.astype(int) - photo.rgb).max(axis=2) > 40
    mask = street.desk.stored(item.annotation_id).annotation.detection.mask
    assert mask is not None and changed[mask].mean() > 0.5 and changed[:20].mean() < 0.05
    scene = street.client.get(told.scene)
    assert scene.headers["content-type"] == "model/gltf-binary"
    assert struct.unpack("<4sII", scene.content[:12]) == (b"glTF", 2, len(scene.content))


def pixels(served: Served, told: Any) -> np.ndarray[Any, np.dtype[np.uint8]]:
    return np.asarray(Image.open(io.BytesIO(served.client.get(told["picture"]).content)))


def test_it_stands_where_the_old_one_stands_on_the_page(street: Served, small_library: Library) -> None:
    """The page tells the old object as it was corrected; the new one is placed as by `cadpose replace`."""
    stored = street.desk.stored(street.ids()[0]).annotation
    photo = street.desk.photo(stored.photo_sha256, stored.photo_name)
    van = small_library.get("made/car/van.glb")
    moved = Pose4Dof(Rotation(40.0, 10.0), 0.9 * stored.pose.focal_px, (205.0, 150.0))
    old = replace(stored, pose=moved)
    expected = Replacer(small_library).replace(photo, old, van, shadow=False)
    hull = small_library.mesh(stored.cad).hull
    rect = projected_rectangle(moved.rotation.to_matrix(), hull, t_z=moved.t_z)[0]
    rows = np.flatnonzero((expected.coverage > 0.5).any(axis=1))
    lowest = moved.principal_px[1] + moved.focal_px * float(rect[3])
    assert rows[-1] + 1 == pytest.approx(lowest, abs=2)
    told = replaced(street, now={"pose": PoseShape.of(moved).model_dump()}, shadow=False)
    assert (pixels(street, told) == expected.picture).all()


def test_model_and_region_of_the_draft_count(street: Served, small_library: Library) -> None:
    stored = street.desk.stored(street.ids()[0]).annotation
    photo = street.desk.photo(stored.photo_sha256, stored.photo_name)
    chair, van = (small_library.get(f"made/{name}") for name in ("chair/plain.obj", "car/van.glb"))
    mask = np.zeros((photo.height, photo.width), np.bool_)
    mask[90:200, 120:300] = True
    region = {"box": [120.0, 90.0, 300.0, 200.0], "mask": RleShape.of(mask).model_dump()}
    told = replaced(street, now={"cad_id": chair.id, "region": region}, shadow=False)
    old = replace(
        stored,
        candidates=(replace(stored.candidates[0], cad=chair),),
        detection=replace(stored.detection, mask=mask),
    )
    expected = Replacer(small_library).replace(photo, old, van, shadow=False)
    assert (pixels(street, told) == expected.picture).all() and expected.removed[mask].all()
    refused = replaced(street, 422, now={"region": region | {"mask": None}})
    assert "has no mask" in refused["error"]


def test_what_cannot_be_replaced(street: Served) -> None:
    assert replaced(street, 422, cad_id="made/car/vin.glb")["kind"] == "bad_input"
    assert replaced(street, 422, now={"pose": {"azimuth": 1}})["kind"] == "bad_input"
    assert replaced(street, 422, now={"cad_id": "made/car/vin.glb"})["kind"] == "bad_input"
    assert replaced(street, 422, now={"region": {"box": [9, 9, 9, 9], "mask": None}})["kind"] == "bad_input"
    # Where the new model stands is not the page's to say.
    assert replaced(street, 422, pose=None)["kind"] == "bad_input"
    assert replaced(street, 422, size="huge")["kind"] == "bad_input"
    assert street.post(f"/api/annotations/{'0' * 64}/replace", {"cad_id": "x"}, 404)["kind"] == "not_found"


@pytest.mark.parametrize("name", ["0" * 32, "x", "..%2f..%2fa"])
def test_unknown_results(street: Served, name: str) -> None:
    for path in (f"/api/replacements/{name}/picture.png", f"/api/replacements/{name}/scene.glb"):
        assert street.get(path, 404)["kind"] == "not_found"
