"""Exports from the page: every format, whole, and what is missing said beforehand."""

from __future__ import annotations

import io
import json
import tempfile
import zipfile
from pathlib import Path

import pytest

from cadpose.annotations.formats.registry import FORMATS, documents_from
from cadpose.annotations.store import Author
from cadpose.library.catalogue import Library
from cadpose.review import exporting
from tests.annotations.formats.made import Made
from tests.review.serving import Served, serve


@pytest.mark.parametrize("name", FORMATS)
def test_every_format(shared: Served, tmp_path: Path, name: str) -> None:
    for package, formats in (("pyarrow", ("parquet",)), ("pxr", ("usd",))):
        if name in formats:
            pytest.importorskip(package)
    answer = shared.client.get(f"/api/export/{name}")
    assert answer.status_code == 200, answer.text
    said = answer.headers["content-disposition"]
    assert said.startswith("attachment") and f"cadpose-{name}" in said
    if FORMATS[name].folder:
        assert answer.headers["content-type"] == "application/zip"
        with zipfile.ZipFile(io.BytesIO(answer.content)) as zipped:
            assert all(entry.startswith(f"cadpose-{name}/") for entry in zipped.namelist())
            zipped.extractall(tmp_path)
        place = tmp_path / f"cadpose-{name}"
    else:
        place = tmp_path / said.split('"')[1]
        place.write_bytes(answer.content)
    assert sum(len(document.annotations) for document in documents_from(name, place)) == 4
    assert not list(Path(tempfile.gettempdir()).glob("cadpose-export-*/cadpose-*"))


def test_by_verdict(served: Served) -> None:
    first, second = served.ids()[:2]
    served.desk.store.decide(first, "reject", Author("Bea"), expected_version=1)
    served.desk.store.decide(second, "accept", Author("Bea"), expected_version=1)

    def count(query: str) -> int:
        answer = served.client.get(f"/api/export/coco{query}")
        assert answer.status_code == 200, answer.text
        return len(json.loads(answer.content)["annotations"])

    assert count("") == 3  # what a person rejected is left out
    assert count("?verdict=accept") == 1
    assert count("?verdict=accept&verdict=reject&verdict=review") >= 3
    told = served.get("/api/export/coco?verdict=skip", 422)
    assert "no annotation of that choice" in told["error"]
    assert served.get("/api/export/coco?verdict=maybe", 422)["kind"] == "bad_input"


def test_what_is_missing_is_said(tmp_path: Path, made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exporting, "find_spec", lambda name: None)
    served = serve(tmp_path, None, made)
    try:
        needs = {f["name"]: f["needs"] for f in served.get("/api/session")["formats"]}
        assert "cadpose[parquet]" in needs["parquet"] and "cadpose[usd]" in needs["usd"]
        assert "--library" in needs["gltf"] and needs["coco"] == needs["csv"] == needs["label-studio"] == ""
        for name in ("parquet", "usd", "gltf"):
            assert served.get(f"/api/export/{name}", 422)["error"] == needs[name]
    finally:
        served.close()


def test_photos_that_are_not_at_hand(tmp_path: Path, small_library: Library, made: Made) -> None:
    (tmp_path / "elsewhere").mkdir()
    served = serve(tmp_path, small_library, made, photos=[tmp_path / "elsewhere"])
    try:
        needs = {f["name"]: f["needs"] for f in served.get("/api/session")["formats"]}
        assert "--photos" in needs["gltf"] and needs["coco"] == ""
        assert served.client.get("/api/export/coco").status_code == 200
    finally:
        served.close()


def test_unknown_formats(shared: Served) -> None:
    for name in ("excel", "COCO", "x" * 41):
        assert shared.get(f"/api/export/{name}", 404)["kind"] == "not_found"
