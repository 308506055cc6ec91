from __future__ import annotations

import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cadpose.annotations.document import document_from
from cadpose.annotations.scenes.usd import read_usd_scene, write_usd_scene
from cadpose.errors import CadposeError, DependencyError, InputError, LibraryError
from cadpose.geometry.frames import FloatArray
from tests.annotations.factory import make_photo
from tests.annotations.scenes.made import BLOCK, POSES, SHELF, Shelf, annotated, street

pxr: Any = pytest.importorskip("pxr", reason="needs usd-core: pip install 'cadpose[usd]'")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdUtils, UsdValidation  # noqa: E402

WIDTH, HEIGHT = 120, 80


def written(tmp_path: Path, **options: Any) -> tuple[Path, Any]:
    photo, document = street(WIDTH, HEIGHT)
    path = tmp_path / "made" / "scene.usdz"
    write_usd_scene(document, SHELF, photo, path, **options)
    return path, Usd.Stage.Open(str(path))


def pixels_of(stage: Any, prim: Any) -> FloatArray:
    """Where the stage's own camera sees the points below a prim, by USD's matrices alone."""
    frustum = UsdGeom.Camera.Get(stage, "/Scene/PhotoCamera").GetCamera().frustum
    seen = np.array(frustum.ComputeViewMatrix() * frustum.ComputeProjectionMatrix())
    places = UsdGeom.XformCache()
    found = []
    for mesh in (p for p in Usd.PrimRange(prim) if p.IsA(UsdGeom.Mesh)):
        points = np.array(UsdGeom.Mesh(mesh).GetPointsAttr().Get(), np.float64)
        whole = np.concatenate([points, np.ones((len(points), 1))], axis=1)
        clip = whole @ np.array(places.GetLocalToWorldTransform(mesh)) @ seen
        x, y = (clip[:, :2] / clip[:, 3:]).T
        found.append(np.stack([(x + 1) / 2 * WIDTH, (1 - y) / 2 * HEIGHT], axis=1))
    return np.concatenate(found)


def test_the_annotations_come_back(tmp_path: Path) -> None:
    path, _ = written(tmp_path)
    _, document = street()
    assert read_usd_scene(path) == document
    assert [p.name for p in path.parent.iterdir()] == ["scene.usdz"]


def test_usds_camera_sees_every_model_on_its_pixels(tmp_path: Path) -> None:
    _, stage = written(tmp_path)
    _, document = street()
    for number, annotation in enumerate(document.to_annotations()):
        pixels = pixels_of(stage, stage.GetPrimAtPath(f"/Scene/Object_{number + 1}"))
        expected = annotation.pose.project(np.asarray(SHELF.mesh(annotation.cad).vertices))
        for pixel in expected:
            assert np.abs(pixels - pixel).max(axis=1).min() < 1e-3
    corners = pixels_of(stage, stage.GetPrimAtPath("/Scene/Photo"))
    assert corners == pytest.approx(np.array([[0, 80], [120, 80], [120, 0], [0, 0]]), abs=1e-3)


def test_the_frame_is_the_photo(tmp_path: Path) -> None:
    _, stage = written(tmp_path)
    camera = UsdGeom.Camera.Get(stage, "/Scene/PhotoCamera").GetCamera()
    assert camera.aspectRatio == pytest.approx(WIDTH / HEIGHT)
    assert camera.transform == Gf.Matrix4d(1.0)
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0


def test_one_object_is_placed_rigidly(tmp_path: Path) -> None:
    photo = make_photo()
    annotations = annotated(photo, [BLOCK], POSES[:1])
    path = tmp_path / "one.usdz"
    write_usd_scene(document_from(photo, annotations), SHELF, photo, path)
    stage = Usd.Stage.Open(str(path))
    place = np.array(
        UsdGeom.XformCache().GetLocalToWorldTransform(stage.GetPrimAtPath("/Scene/Object_1/Model"))
    )
    lengths = np.linalg.svd(place[:3, :3], compute_uv=False)
    assert lengths == pytest.approx(np.linalg.norm([0.30, 0.86, 0.40]))


def test_leant_models_are_two_steps_that_programs_can_split(tmp_path: Path) -> None:
    _, stage = written(tmp_path)
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Xformable):
            linear = np.array(UsdGeom.Xformable(prim).GetLocalTransformation())[:3, :3]
            rows = linear @ linear.T
            assert rows == pytest.approx(np.diag(np.diag(rows)), abs=1e-6), prim.GetPath()


def test_usds_own_validators_find_nothing(tmp_path: Path) -> None:
    path, stage = written(tmp_path)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    found = UsdValidation.ValidationContext(validators).Validate(stage)
    assert [f"{error.GetName()}: {error.GetMessage()}" for error in found] == []
    _, assets, unresolved = UsdUtils.ComputeAllDependencies(str(path))
    assert unresolved == []
    assert len(assets) == 3


def test_materials_are_preview_surfaces(tmp_path: Path) -> None:
    path, stage = written(tmp_path)
    looks = {prim.GetDisplayName(): prim for prim in stage.GetPrimAtPath("/Scene/Looks").GetChildren()}
    assert set(looks) == {"", "painted", "plain", "glass", "lattice"}  # without a name: the photo's

    def told(name: str) -> dict[str, Any]:
        surface = UsdShade.Shader(looks[name].GetChild("Surface"))
        assert surface.GetIdAttr().Get() == "UsdPreviewSurface"
        return {i.GetBaseName(): i for i in surface.GetInputs()}

    assert told("plain")["diffuseColor"].Get() == pytest.approx((0.2140, 0.0509, 0.5225), abs=1e-4)
    assert told("glass")["opacity"].Get() == pytest.approx(0.4)
    assert told("lattice")["opacityThreshold"].Get() == 0.5
    assert told("lattice")["opacity"].HasConnectedSource()
    assert told("painted")["diffuseColor"].HasConnectedSource()
    assert told("painted")["opacity"].Get() == 1.0
    texture = UsdShade.Shader(looks["painted"].GetChild("Texture"))
    file = texture.GetInput("file").Get()
    assert file.resolvedPath == f"{path}[{file.path.removeprefix('./')}]"
    with zipfile.ZipFile(path) as package:
        assert package.namelist()[0] == "scene.usdc"
        assert all(not name.startswith("/") and ".." not in name for name in package.namelist())


def test_creators_and_licences_are_named(tmp_path: Path) -> None:
    path, stage = written(tmp_path)
    told = stage.GetPrimAtPath("/Scene/Object_2").GetCustomData()["cadpose"]
    assert told["cad"]["licence"] == "CC0-1.0"
    assert "metres_per_diagonal" not in told
    assert tuple(told["pose"]["principal_px"]) == POSES[1].principal_px
    layer = Sdf.Layer.FindOrOpen(str(path))
    assert "Long block by A. Maker (CC-BY-3.0)" in layer.customLayerData["cadpose"]["credits"]
    assert "unknown size has a bounding-box diagonal of 1" in layer.customLayerData["cadpose"]["unit"]


def test_what_is_no_scene_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wrong.usdz"
    path.write_bytes(b"PK nonsense")
    with pytest.raises(InputError, match="no scene that cadpose exported"):
        read_usd_scene(path)
    Usd.Stage.CreateNew(str(tmp_path / "other.usda")).Save()
    with pytest.raises(InputError, match="no scene that cadpose exported"):
        read_usd_scene(tmp_path / "other.usda")
    with pytest.raises(InputError, match="no such file"):
        read_usd_scene(tmp_path / "none.usdz")


def test_a_model_that_is_gone_leaves_no_file(tmp_path: Path) -> None:
    photo, document = street()
    with pytest.raises(LibraryError, match="There is no CAD model"):
        write_usd_scene(document, Shelf({}), photo, tmp_path / "scene.usdz")
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    photo, document = street()
    (tmp_path / "file").write_text("")
    with pytest.raises(CadposeError, match="cannot write"):
        write_usd_scene(document, SHELF, photo, tmp_path / "file" / "scene.usdz")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "gone"))
    with pytest.raises(CadposeError, match=r"cannot put .*scene\.usdz together in .*gone: No such file"):
        write_usd_scene(document, SHELF, photo, tmp_path / "scene.usdz")


def test_without_usd_core_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pxr", None)
    photo, document = street()
    with pytest.raises(DependencyError, match=r"cadpose\[usd\]"):
        write_usd_scene(document, SHELF, photo, tmp_path / "scene.usdz")
