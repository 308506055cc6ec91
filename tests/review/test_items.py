"""The queue, one annotation with all that belongs to it, its photo and thumbnail."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from cadpose.review.answers import AnnotationAnswer, QueueAnswer, SessionAnswer
from cadpose.rle import decode_mask, runs_from_text
from tests.annotations.formats.made import Made
from tests.review.serving import Served, serve


def test_the_session(shared: Served, made: Made) -> None:
    told = SessionAnswer.model_validate(shared.get("/api/session"))
    assert told.author == "Ada" and told.store.endswith("review.db")
    assert told.library is not None and told.library.models == 5
    assert told.library.categories == {"car": 3, "chair": 2}
    assert told.actions.annotate and told.actions.snap
    assert {f.name for f in told.formats} >= {"coco", "bop", "csv"}
    assert all(not f.needs for f in told.formats if f.name in ("coco", "gltf", "bop", "csv"))
    assert "duplicate" in told.reasons


def test_the_queue_by_pages(shared: Served) -> None:
    whole = QueueAnswer.model_validate(shared.get("/api/queue"))
    assert whole.total == 4 and len(whole.items) == 4 and whole.after is None
    # No confidence first.
    assert whole.items[0].confidence is None
    first = QueueAnswer.model_validate(shared.get("/api/queue?limit=3"))
    rest = QueueAnswer.model_validate(shared.get(f"/api/queue?limit=3&after={first.after}"))
    assert [*first.items, *rest.items] == list(whole.items) and rest.after is None


@pytest.mark.parametrize(
    ("query", "count"),
    [
        ("category=car", 3),
        ("category=chair", 1),
        ("verdict=review&verdict=reject", 3),
        ("verdict=undecided", 1),
        ("text=street", 3),
        ("min_confidence=0.5", 3),
        ("max_confidence=0.5", 0),
        ("decided_by=human", 0),
        ("cad_id=made/car/van.glb", 1),
    ],
)
def test_what_the_queue_takes(shared: Served, query: str, count: int) -> None:
    assert shared.get(f"/api/queue?{query}")["total"] == count


@pytest.mark.parametrize(
    "query",
    [
        "limit=0", "limit=1001", "limit=x", "verdict=maybe", "min_confidence=nan", "min_confidence=2",
        "decided_by=god", "after=x", "text=" + "x" * 501,
    ],
)  # fmt: skip
def test_queries_that_cannot_be_used(shared: Served, query: str) -> None:
    told = shared.get(f"/api/queue?{query}", 422)
    assert told["kind"] == "bad_input" and told["error"]


def test_an_annotation(shared: Served, made: Made) -> None:
    document = made.documents[0]
    for key in shared.ids():
        told = AnnotationAnswer.model_validate(shared.get(f"/api/annotations/{key}"))
        stored = shared.desk.stored(key).annotation
        assert told.id == key and told.version == 1 and told.in_force
        assert told.pose.pose(stored.photo_size) == stored.pose
        assert told.machine.pose == told.pose and told.machine.cad == told.cad
        assert told.cad.available and told.cad.key == stored.cad.sha256
        assert [c.rank for c in told.candidates] == list(range(1, len(stored.candidates) + 1))
        assert told.photo.image is not None
        assert len(told.hypotheses) == len(stored.hypotheses)
        if told.detection.mask is None:
            assert stored.detection.mask is None
        else:
            mask = decode_mask(told.detection.mask.size, runs_from_text(told.detection.mask.counts))
            assert stored.detection.mask is not None and (mask == stored.detection.mask).all()
        if told.photo.sha256 == document.photo.sha256:
            assert len(told.siblings) == 2 and key in told.siblings
        if stored.refinement is not None:
            assert told.start is not None and told.start.pose(stored.photo_size) == stored.refinement.start


def test_unknown_names_are_not_found(shared: Served) -> None:
    for name in ("0" * 64, "0" * 63, "..%2f..%2fetc%2fpasswd", "x", "A" * 64):
        for path in (f"/api/annotations/{name}", f"/api/photos/{name}/image", f"/api/cads/{name}/mesh.glb"):
            assert shared.get(path, 404)["kind"] == "not_found"


def test_a_photo_is_encoded_anew(shared: Served, made: Made) -> None:
    document = made.documents[0]
    path = f"/api/photos/{document.photo.sha256}/image"
    answer = shared.client.get(path)
    assert answer.headers["content-type"] == "image/jpeg"
    assert "immutable" in answer.headers["cache-control"] and "private" in answer.headers["cache-control"]
    assert Image.open(io.BytesIO(answer.content)).size == document.photo.size
    small = Image.open(io.BytesIO(shared.client.get(f"{path}?side=60").content))
    assert small.size == (60, 40)
    for side in ("0", "99999", "x"):
        assert shared.get(f"{path}?side={side}", 422)["kind"] == "bad_input"


def test_a_thumbnail(shared: Served) -> None:
    for item in shared.get("/api/queue")["items"]:
        answer = shared.client.get(item["thumb"])
        assert answer.status_code == 200 and "immutable" in answer.headers["cache-control"]
        picture = np.asarray(Image.open(io.BytesIO(answer.content)))
        assert picture.shape == (96, 96, 3)


def test_a_thumbnail_without_its_model_is_not_kept(tmp_path: Path, made: Made) -> None:
    served = serve(tmp_path, None, made)
    try:
        answer = served.client.get(served.get("/api/queue")["items"][0]["thumb"])
        assert answer.status_code == 200 and answer.headers["cache-control"] == "no-store"
    finally:
        served.close()


def test_a_photo_that_is_not_at_hand(served: Served) -> None:
    served.desk.photos.folders = ()
    key = served.ids()[0]
    told = served.get(f"/api/annotations/{key}")
    assert told["photo"]["image"] is None
    answer = served.client.get(f"/api/annotations/{key}/thumb.jpg")
    assert answer.status_code == 404 and answer.headers["content-type"] == "image/png"
    assert answer.headers["cache-control"] == "no-store"
    refused = served.get(f"/api/photos/{told['photo']['sha256']}/image", 404)
    assert "--photos" in refused["error"]


def test_siblings_are_listed_as_they_stand(shared: Served, made: Made) -> None:
    for document in made.documents:
        sha256 = document.photo.sha256
        standing = shared.desk.store.standing(sha256)
        assert shared.desk.store.items(sha256) == [stored.item for stored in standing]
