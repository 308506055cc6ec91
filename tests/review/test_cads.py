"""The library on the page: search, meshes, portraits, symmetries."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from cadpose.geometry.symmetry_groups import SymmetryGroup, rotation_about
from cadpose.library.catalogue import Library
from cadpose.review.answers import CadsAnswer, SymmetryAnswer
from cadpose.review.models import Models
from tests.review.serving import Served, serve


def test_search(shared: Served) -> None:
    every = CadsAnswer.model_validate(shared.get("/api/cads"))
    assert len(every.items) == 5 and every.after is None
    names = [cad.name.casefold() for cad in every.items]
    assert names == sorted(names) and all(cad.available for cad in every.items)
    for query, count in (
        ("category=chair", 2), ("text=VAN", 1), ("text=car%20van", 1), ("text=zebra", 0), ("text=chair", 2),
        ("category=zebra", 0), ("category=car&text=throne", 0),
    ):  # fmt: skip
        assert len(shared.get(f"/api/cads?{query}")["items"]) == count, query


def test_search_by_pages(shared: Served) -> None:
    after, found = "", []
    for _ in range(5):
        page = CadsAnswer.model_validate(shared.get(f"/api/cads?limit=2&after={after}"))
        found += [cad.id for cad in page.items]
        if page.after is None:
            break
        after = page.after
    assert len(found) == len(set(found)) == 5
    assert shared.get("/api/cads?after=nothing")["items"] == []


def test_a_mesh(shared: Served) -> None:
    library = shared.desk.models.opened()
    for cad in library.models():
        answer = shared.client.get(f"/api/cads/{cad.sha256}/mesh.glb")
        assert answer.headers["content-type"] == "model/gltf-binary"
        assert "immutable" in answer.headers["cache-control"]
        scene: Any = trimesh.load(io.BytesIO(answer.content), file_type="glb")
        mesh = library.mesh(cad)
        # Own axes, a diagonal of 1, and every triangle.
        assert np.allclose(scene.bounds, mesh.bounds, atol=1e-6)
        assert sum(len(part.faces) for part in scene.geometry.values()) == len(mesh.faces)
        colours = {tuple(np.round(m.rgba, 2)) for m in mesh.materials}
        assert len(scene.geometry) == len(colours)


def test_a_portrait(shared: Served) -> None:
    key = shared.desk.models.opened().models()[0].sha256
    one = shared.client.get(f"/api/cads/{key}/thumb.png?azimuth=43.2&elevation=11&size=100")
    picture = Image.open(io.BytesIO(one.content))
    assert picture.size == (112, 112) and picture.mode == "RGBA"
    alpha = np.asarray(picture)[..., 3]
    assert alpha.min() == 0 and alpha.max() == 255
    same = shared.client.get(f"/api/cads/{key}/thumb.png?azimuth=405&elevation=9&size=112")
    other = shared.client.get(f"/api/cads/{key}/thumb.png?azimuth=60&elevation=9&size=112")
    assert same.content == one.content != other.content
    for query in ("size=9999", "azimuth=nan", "elevation=95", "inplane=inf"):
        assert shared.client.get(f"/api/cads/{key}/thumb.png?{query}").status_code == 422


def test_a_symmetry(shared: Served) -> None:
    for cad in shared.desk.models.opened().models():
        told = SymmetryAnswer.model_validate(shared.get(f"/api/cads/{cad.sha256}/symmetry"))
        group = shared.desk.models.opened().symmetry(cad)
        assert told.name == group.name and told.continuous == (group.axis is not None)
        assert len(told.R) == len(group.rotations) - 1 or told.continuous


@pytest.mark.parametrize(
    ("group", "twins", "continuous"),
    [
        (SymmetryGroup.trivial(), 0, False),
        (SymmetryGroup.cyclic(4), 3, False),
        (SymmetryGroup.dihedral(6), 11, False),
        (SymmetryGroup.cyclic(60), 24, False),
        (SymmetryGroup.revolution(), 7, True),
        (SymmetryGroup.revolution(two_sided=True), 15, True),
        (SymmetryGroup.sphere(), 7, True),
    ],
)
def test_twins(
    small_library: Library,
    monkeypatch: pytest.MonkeyPatch,
    group: SymmetryGroup,
    twins: int,
    continuous: bool,
) -> None:
    monkeypatch.setattr(Library, "symmetry", lambda self, cad: group)
    name, turns, told = Models(small_library).twins(small_library.models()[0])
    assert (name, len(turns), told) == (group.name, twins, continuous)
    for turn in np.array(turns).reshape(-1, 3, 3):
        assert not np.allclose(turn, np.eye(3)) and np.linalg.det(turn) == pytest.approx(1.0)
        assert group.geodesic_degrees(turn, np.eye(3)) < 1e-3
    if name == "C4":
        assert np.allclose(np.array(turns[0]).reshape(3, 3), rotation_about((0, 1, 0), 90.0))


def test_without_a_library(tmp_path: Path) -> None:
    served = serve(tmp_path, None)
    try:
        assert served.get("/api/cads")["items"] == []
        assert served.get(f"/api/cads/{'0' * 64}/symmetry", 404)["kind"] == "not_found"
        answer = served.client.post("/api/photos?name=a.jpg", content=b"x")
        assert answer.status_code == 422 and "no CAD library" in answer.json()["error"]
    finally:
        served.close()
