"""Whatever JSON comes, the answer is one of ours: never a failure of the server."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from starlette.requests import ClientDisconnect

from cadpose.library.catalogue import Library
from cadpose.review.refusals import STATUS
from tests.annotations.formats.made import Made
from tests.review.serving import Served, serve

JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=9), inner, max_size=4),
    max_leaves=10,
)
NUMBER = st.floats(allow_nan=False) | st.sampled_from([0, -1, 1e-320, 1e308, 90, 2, "2", None, True])
POSE = st.fixed_dictionaries(
    dict.fromkeys(("azimuth", "elevation", "inplane", "focal_px", "t_z"), NUMBER)
    | {"principal_px": st.lists(NUMBER, max_size=3)}
)
MASK = st.fixed_dictionaries(
    {
        "size": st.lists(st.integers(-1, 10**9), max_size=3) | st.just([80, 120]),
        "counts": st.text(max_size=30),
    }
)
REGION = st.fixed_dictionaries({"box": st.lists(NUMBER, max_size=5), "mask": st.none() | MASK})
CAR = "made/car/van.glb"
#: Stands for the version that the annotation has.
PRESENT = "the present one"
ANY_POSE, ANY_REGION = st.none() | POSE | JSON, st.none() | REGION | JSON


def told(served: Served, path: str, body: Any) -> None:
    answer = served.client.post(path, content=json.dumps(body))
    assert answer.status_code in {422, 404, 409} | ({200} if "error" not in answer.json() else set())
    if answer.status_code != 200:
        error = answer.json()
        assert STATUS[error["kind"]] == answer.status_code
        assert error["error"] and "\n" not in error["error"] and "Traceback" not in error["error"]


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    body=st.fixed_dictionaries(
        {
            "verdict": st.sampled_from(["accept", "edit", "reject", "x", None]),
            "version": st.sampled_from([PRESENT, PRESENT, 10**6]) | JSON,
        },
        optional={
            "pose": ANY_POSE,
            "region": ANY_REGION,
            "cad_id": st.just(CAR) | JSON,
            "author": JSON,
            "note": JSON,
            "request_id": st.text("0123456789abcdef", min_size=31, max_size=33) | JSON,
        },
    )
    | JSON
)
def test_decisions(shared: Served, body: Any) -> None:
    key = shared.ids()[0]
    if isinstance(body, dict) and body.get("version") == PRESENT:
        body = body | {"version": shared.desk.stored(key).item.version}
    told(shared, f"/api/annotations/{key}/decisions", body)
    shared.get(f"/api/annotations/{key}")


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(pose=ANY_POSE, region=ANY_REGION, cad=st.just("made/car/no.obj") | JSON)
def test_snaps_and_replacements(shared: Served, pose: Any, region: Any, cad: Any) -> None:
    key = shared.ids()[0]
    told(shared, "/api/snap", {"annotation_id": key, "cad_id": cad, "pose": pose, "region": region})
    now = {"pose": pose, "region": region, "cad_id": cad}
    told(shared, f"/api/annotations/{key}/replace", {"cad_id": cad, "now": now})
    # With a model that is there, everything else is looked at too.
    told(shared, "/api/snap", {"annotation_id": key, "cad_id": CAR, "pose": pose, "region": region})
    told(shared, f"/api/annotations/{key}/replace", {"cad_id": CAR, "now": now})


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(pose=POSE, region=st.none() | REGION)
def test_edits_that_may_be_taken(shared: Served, pose: Any, region: Any) -> None:
    """With the right version: taken, or refused in one sentence, and the annotation can still be read."""
    key = shared.ids()[-1]
    version = shared.get(f"/api/annotations/{key}")["version"]
    told(
        shared,
        f"/api/annotations/{key}/decisions",
        {"verdict": "edit", "version": version, "pose": pose, "region": region},
    )
    shared.get(f"/api/annotations/{key}")
    assert shared.client.get(f"/api/annotations/{key}/thumb.jpg").status_code in (200, 404)


def test_a_failure_of_the_server_is_one_sentence(
    tmp_path: Any, small_library: Library, made: Made, monkeypatch: pytest.MonkeyPatch
) -> None:
    served = serve(tmp_path, small_library, made, raising=False)
    try:

        def broken(*args: Any, **words: Any) -> Any:
            raise RuntimeError("secret detail")

        monkeypatch.setattr(served.desk.store, "queue", broken)
        told = served.get("/api/queue", 500)
        assert told["kind"] == "failed" and "secret" not in told["error"]
    finally:
        served.close()


def test_an_upload_that_is_broken_off(served: Served, monkeypatch: pytest.MonkeyPatch) -> None:
    async def gone(self: Any) -> Any:
        yield b"x"
        raise ClientDisconnect

    monkeypatch.setattr("starlette.requests.Request.stream", gone)
    answer = served.client.post("/api/photos?name=a.jpg", content=b"x")
    assert answer.status_code == 422 and "broken off" in answer.json()["error"]
    assert list(served.desk.photos.uploads.iterdir()) == []
