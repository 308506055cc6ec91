from __future__ import annotations

import io
import json
import math
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from cadpose.annotations.document import document_from
from cadpose.annotations.scenes.glb import read_header
from cadpose.annotations.scenes.gltf import read_gltf_scene, write_gltf_scene
from cadpose.annotations.scenes.layout import SceneCamera
from cadpose.errors import CadposeError, InputError, LibraryError
from cadpose.library.loading import load_mesh_file
from cadpose.records import Photo
from tests.annotations.factory import make_photo
from tests.annotations.scenes.made import SHELF, Shelf, annotated, block, street


def header_of(data: bytes) -> dict[str, Any]:
    return read_header(io.BytesIO(data), len(data))


def written(tmp_path: Path, **options: Any) -> tuple[Path, dict[str, Any]]:
    photo, document = street()
    path = tmp_path / "made" / "scene.glb"
    write_gltf_scene(document, SHELF, photo, path, **options)
    return path, header_of(path.read_bytes())


def camera_of(header: dict[str, Any]) -> SceneCamera:
    """The camera as a viewer has it: an angle and an aspect."""
    lens = header["cameras"][0]["perspective"]
    focal = 80 / 2 / math.tan(lens["yfov"] / 2)
    assert lens["aspectRatio"] == pytest.approx(120 / 80)
    return SceneCamera(focal, (60.0, 40.0), 120, 80, lens["znear"], lens["zfar"])


def test_the_annotations_come_back(tmp_path: Path) -> None:
    path, _ = written(tmp_path)
    _, document = street()
    assert read_gltf_scene(path) == document
    assert [a.pose for a in read_gltf_scene(path).to_annotations()] == [
        a.pose for a in document.to_annotations()
    ]
    assert [p.name for p in path.parent.iterdir()] == ["scene.glb"]


def test_another_reader_finds_every_model_on_its_pixels(tmp_path: Path) -> None:
    path, header = written(tmp_path)
    camera = camera_of(header)
    scene: Any = trimesh.load(path)
    _, document = street()
    for number, annotation in enumerate(document.to_annotations()):
        found = []
        for node in scene.graph.nodes_geometry:
            if node.startswith(f"{number + 1} "):
                matrix, name = scene.graph[node]
                points = np.asarray(scene.geometry[name].vertices)
                found.append(camera.project(points @ matrix[:3, :3].T + matrix[:3, 3]))
        pixels = np.concatenate(found)
        expected = annotation.pose.project(np.asarray(SHELF.mesh(annotation.cad).vertices))
        for pixel in expected:
            assert np.abs(pixels - pixel).max(axis=1).min() < 1e-3
        for pixel in pixels:
            assert np.abs(expected - pixel).max(axis=1).min() < 1e-3


def test_the_camera_stands_at_the_origin_and_the_photo_fills_its_frame(tmp_path: Path) -> None:
    _, header = written(tmp_path)
    nodes = {node["name"]: node for node in header["nodes"]}
    assert set(nodes["photo camera"]) == {"name", "camera", "extras"}
    mesh = header["meshes"][nodes["photo"]["mesh"]]
    bounds = header["accessors"][mesh["primitives"][0]["attributes"]["POSITION"]]
    corners = np.array([bounds["min"], bounds["max"]])
    assert camera_of(header).project(corners) == pytest.approx(np.array([[0, 80], [120, 0]]), abs=1e-3)
    material = header["materials"][mesh["primitives"][0]["material"]]
    assert "KHR_materials_unlit" in material["extensions"]


def test_nodes_carry_turns_and_scales_only(tmp_path: Path) -> None:
    # The format allows a matrix only where it is one; a viewer would split a leaning one wrongly.
    _, header = written(tmp_path)
    assert all("matrix" not in node for node in header["nodes"])
    _, rigid = written(tmp_path, placement="rigid")
    scales = [node["scale"] for node in rigid["nodes"] if "scale" in node]
    assert len(scales) == 3
    for scale in scales:
        assert scale == pytest.approx([scale[0]] * 3)


def test_a_model_is_stored_once_however_often_it_stands_there(tmp_path: Path) -> None:
    _, header = written(tmp_path)
    assert len(header["meshes"]) == 3
    bodies = [node["mesh"] for node in header["nodes"] if node["name"].endswith(": model")]
    assert bodies[0] == bodies[2] != bodies[1]
    assert len(header["images"]) == 3  # the photo, the painted and the cut-out texture


def test_materials_cover_as_they_do_here(tmp_path: Path) -> None:
    _, header = written(tmp_path)
    found = {m["name"]: m for m in header["materials"]}
    assert {name: m["alphaMode"] for name, m in found.items() if name != "photo"} == {
        "painted": "OPAQUE",
        "plain": "OPAQUE",
        "glass": "BLEND",
        "lattice": "MASK",
    }
    factor = found["plain"]["pbrMetallicRoughness"]["baseColorFactor"]
    assert factor == pytest.approx([0.2140, 0.0509, 0.5225, 1.0], abs=1e-4)  # linear light
    assert "baseColorTexture" in found["painted"]["pbrMetallicRoughness"]


def test_creators_and_licences_are_named(tmp_path: Path) -> None:
    _, header = written(tmp_path)
    told = header["asset"]["copyright"]
    assert "Long block by A. Maker (CC-BY-3.0)" in told
    assert "Öther by an unknown creator (CC0-1.0)" in told
    assert "/home" not in told
    extras = next(node["extras"]["cadpose"] for node in header["nodes"] if node["name"] == "2 Öther")
    assert extras["cad"]["licence"] == "CC0-1.0"
    assert extras["metres_per_diagonal"] is None
    assert extras["annotation"] == 1
    assert extras["pose"]["focal_px"] == 45.0


def test_our_own_importer_reads_it(tmp_path: Path) -> None:
    path, _ = written(tmp_path)
    mesh = load_mesh_file(path)
    assert len(mesh.faces) == 2 + 10 + 12 + 10


def test_the_same_scene_has_the_same_bytes(tmp_path: Path) -> None:
    first, second = (written(tmp_path / name)[0].read_bytes() for name in "ab")
    assert first == second


def test_a_photo_without_objects(tmp_path: Path) -> None:
    photo = make_photo()
    path = tmp_path / "empty.glb"
    write_gltf_scene(document_from(photo, []), SHELF, photo, path)
    assert read_gltf_scene(path).annotations == ()
    assert "CAD models" not in header_of(path.read_bytes())["asset"]["copyright"]


def test_another_photo_is_refused(tmp_path: Path) -> None:
    photo, document = street()
    other = make_photo("other.jpg")
    for wrong in (other, Photo(photo.rgb[:40], photo.name, photo.sha256)):
        with pytest.raises(InputError, match="is not the photo that was annotated"):
            write_gltf_scene(document, SHELF, wrong, tmp_path / "scene.glb")


def test_a_model_that_is_gone_or_another_leaves_no_file(tmp_path: Path) -> None:
    photo, document = street()
    with pytest.raises(LibraryError, match="There is no CAD model"):
        write_gltf_scene(document, Shelf({}), photo, tmp_path / "scene.glb")
    changed = {
        cad_id: (type(cad)(**{**{f: getattr(cad, f) for f in cad.__slots__}, "sha256": "00" * 32}), mesh)
        for cad_id, (cad, mesh) in SHELF.models.items()
    }
    with pytest.raises(InputError, match="not the one that was annotated"):
        write_gltf_scene(document, Shelf(changed), photo, tmp_path / "scene.glb")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written(tmp_path: Path) -> None:
    photo, document = street()
    (tmp_path / "file").write_text("")
    with pytest.raises(CadposeError, match="cannot write"):
        write_gltf_scene(document, SHELF, photo, tmp_path / "file" / "scene.glb")


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"glTF",
        b"x" * 100,
        b"\x89PNG" + bytes(60),
        struct.pack("<5I", 0x46546C67, 2, 100, 0xFFFFFFF0, 0x4E4F534A) + b" " * 80,
        struct.pack("<5I", 0x46546C67, 2, 100, 90, 0x4E4F534A) + b" " * 80,
        struct.pack("<5I", 0x46546C67, 2, 100, 80, 0x4E4F534A) + b"[" * 80,
        struct.pack("<5I", 0x46546C67, 2, 100, 2, 0x4E4F534A) + b"[]",
        struct.pack("<5I", 0x46546C67, 1, 100, 2, 0x4E4F534A) + b"{}",
    ],
)
def test_what_is_no_scene_is_refused(tmp_path: Path, data: bytes) -> None:
    path = tmp_path / "wrong.glb"
    path.write_bytes(data)
    with pytest.raises(InputError, match="no scene that cadpose exported"):
        read_gltf_scene(path)


def test_a_scene_of_others_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "box.glb"
    box: Any = trimesh.creation.box()
    path.write_bytes(box.export(file_type="glb"))
    with pytest.raises(InputError, match="no scene that cadpose exported"):
        read_gltf_scene(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_gltf_scene(tmp_path / "none.glb")


def test_a_document_that_was_changed_is_checked(tmp_path: Path) -> None:
    path, _ = written(tmp_path)
    data = path.read_bytes()
    path.write_bytes(data.replace(b'"focal_px":90.0', b'"focal_px":91.0'))
    with pytest.raises(InputError, match="not a valid"):
        read_gltf_scene(path)
    assert json.loads(json.dumps(header_of(data)))  # the whole one still reads


def test_the_block_is_a_fair_model() -> None:
    mesh = block()
    assert np.linalg.norm(np.ptp(mesh.bounds, axis=0)) == pytest.approx(1.0)
    assert len(annotated(make_photo())) == 3
