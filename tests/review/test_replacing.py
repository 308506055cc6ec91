"""Another model in the object's place, from the page."""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.document import document_from
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation, Candidate, Detection, Pose4Dof, Rotation
from cadpose.review.answers import ReplaceAnswer
from cadpose.review.shapes import PoseShape
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


def replace(served: Served, status: int = 200, **changes: Any) -> Any:
    body = {"cad_id": "made/car/van.glb"} | changes
    return served.post(f"/api/annotations/{served.ids()[0]}/replace", body, status)


def test_a_van_for_a_hatchback(street: Served) -> None:
    assert street.get("/api/session")["actions"]["replace"]
    told = ReplaceAnswer.model_validate(replace(street))
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


def test_where_it_is_told_to_stand(street: Served) -> None:
    there = PoseShape.of(Pose4Dof(Rotation(90.0, 12.0), 300.0, (120.0, 150.0))).model_dump()
    one = street.client.get(replace(street, pose=there, shadow=False)["picture"]).content
    two = street.client.get(replace(street, pose=there, shadow=True)["picture"]).content
    three = street.client.get(replace(street, shadow=False)["picture"]).content
    assert len({one, two, three}) == 3


def test_what_cannot_be_replaced(street: Served) -> None:
    assert replace(street, 422, cad_id="made/car/vin.glb")["kind"] == "bad_input"
    assert replace(street, 422, pose={"azimuth": 1})["kind"] == "bad_input"
    assert replace(street, 422, size="huge")["kind"] == "bad_input"
    assert street.post(f"/api/annotations/{'0' * 64}/replace", {"cad_id": "x"}, 404)["kind"] == "not_found"


@pytest.mark.parametrize("name", ["0" * 32, "x", "..%2f..%2fa"])
def test_unknown_results(street: Served, name: str) -> None:
    for path in (f"/api/replacements/{name}/picture.png", f"/api/replacements/{name}/scene.glb"):
        assert street.get(path, 404)["kind"] == "not_found"
