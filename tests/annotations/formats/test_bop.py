"""A BOP folder: poses, models, masks and results as BOP's toolkit reads them, and changes made there."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from cadpose.annotations.document import document_from
from cadpose.annotations.formats.bop_models import BopModels, diagonal_mm
from cadpose.annotations.formats.registry import documents_from, export
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.parts import CadPart
from cadpose.datasets.bop import bop
from cadpose.datasets.labels import mask_in_photo, object_in_photo
from cadpose.errors import InputError, LibraryError
from cadpose.geometry.frames import R_b_from_s
from cadpose.geometry.symmetry import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.photos import read_photo
from cadpose.records import Annotation
from tests.annotations.factory import make_cad
from tests.annotations.formats import bop_toolkit
from tests.annotations.formats.made import Made


@pytest.fixture(scope="module")
def kept(made: Made, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Not to be changed."""
    return made.export("bop", tmp_path_factory.mktemp("bop") / "set")


@pytest.fixture
def folder(made: Made, tmp_path: Path) -> Path:
    return made.export("bop", tmp_path / "set")


def scene(folder: Path) -> Path:
    return folder / "test" / "000001"


def test_the_toolkits_projection_of_the_exported_model_is_ours(made: Made, kept: Path) -> None:
    poses = bop_toolkit.load_scene_gt(scene(kept) / "scene_gt.json")
    cameras = bop_toolkit.load_scene_camera(scene(kept) / "scene_camera.json")
    info = bop_toolkit.load_json(kept / "models" / "models_info.json")
    parts = [part for document in made.documents for part in document.annotations]
    assert list(poses) == list(cameras) == [0, 1, 2, 3]
    for image, part in enumerate(parts):
        (gt,) = poses[image]
        model = bop_toolkit.load_ply(kept / "models" / f"obj_{gt['obj_id']:06d}.ply")
        told = info[gt["obj_id"]]
        assert told["cad_id"] == part.cad.id
        pixels = cameras[image]["cam_K"] @ (gt["cam_R_m2c"] @ model["pts"].T + gt["cam_t_m2c"])
        pixels = (pixels[:2] / pixels[2]).T
        ours = model["pts"] @ R_b_from_s / told["diagonal_mm"]
        np.testing.assert_allclose(pixels, part.pose.pose().project(ours), atol=1e-6)


def test_the_models_are_the_librarys(made: Made, kept: Path) -> None:
    for number, told in bop_toolkit.load_json(kept / "models" / "models_info.json").items():
        mesh = made.library.mesh(told["cad_id"])
        model = bop_toolkit.load_ply(kept / "models" / f"obj_{number:06d}.ply")
        # The size of these models is not known.
        assert told["diagonal_mm"] == 1000.0 and told["metric"] is False
        corners = model["pts"][model["faces"]] @ R_b_from_s / 1000.0
        np.testing.assert_allclose(corners, mesh.vertices[mesh.faces], atol=1e-12)
        normals = model["normals"][model["faces"]] @ R_b_from_s
        np.testing.assert_allclose(normals, mesh.corner_normals, atol=1e-6)
        low, high = model["pts"].min(axis=0), model["pts"].max(axis=0)
        assert [told[f"min_{a}"] for a in "xyz"] == pytest.approx(low, abs=1e-9)
        assert [told[f"size_{a}"] for a in "xyz"] == pytest.approx(high - low)
        far = np.linalg.norm(model["pts"][:, None] - model["pts"][None], axis=2).max()
        assert told["diameter"] == pytest.approx(far)
        # A car's paint and tyres.
        assert len(np.unique(model["colors"], axis=0)) >= 3


def test_results_targets_and_info(made: Made, kept: Path) -> None:
    poses = bop_toolkit.load_scene_gt(scene(kept) / "scene_gt.json")
    results = bop_toolkit.load_bop_results(kept / "cadpose_annotations-test.csv")
    assert len(results) == 4
    for result in results:
        (gt,) = poses[result["im_id"]]
        assert (result["scene_id"], result["obj_id"]) == (1, gt["obj_id"])
        np.testing.assert_array_equal(result["R"], gt["cam_R_m2c"])
        np.testing.assert_array_equal(result["t"], gt["cam_t_m2c"])
    assert [r["score"] for r in results] == [0.5625, 0.875, 0.5625, 0.5625]
    targets = json.loads((kept / "test_targets_bop19.json").read_text())
    assert [(t["scene_id"], t["im_id"], t["inst_count"]) for t in targets] == [(1, i, 1) for i in range(4)]
    info = bop_toolkit.load_json(scene(kept) / "scene_gt_info.json")
    for image in range(4):
        (told,) = info[image]
        whole, seen = (
            np.asarray(Image.open(scene(kept) / kind / f"{image:06d}_000000.png")) > 0
            for kind in ("mask", "mask_visib")
        )
        assert (told["px_count_all"], told["px_count_visib"]) == (whole.sum(), seen.sum())
        if image == 3:  # posed beyond the photo's lower edge
            assert (told["bbox_obj"], told["visib_fract"]) == ([-1, -1, -1, -1], 0.0)
            continue
        x, y, width, height = told["bbox_obj"]
        rows, columns = np.nonzero(whole)
        assert (x, y) == (columns.min(), rows.min())
        assert (x + width, y + height) == (columns.max() + 1, rows.max() + 1)
        assert told["visib_fract"] == pytest.approx((whole & seen).sum() / whole.sum())
    photo = read_photo(made.folder / "a/street.png")
    for image in (0, 1):
        told_photo = np.asarray(Image.open(scene(kept) / "rgb" / f"{image:06d}.png"))
        np.testing.assert_array_equal(told_photo, photo.rgb)


def test_the_data_set_reader_reads_it(made: Made, kept: Path) -> None:
    labels = list(bop(kept))
    parts = [part for document in made.documents for part in document.annotations]
    assert len(labels) == 4
    for label, part in zip(labels, parts, strict=True):
        pose = part.pose
        assert (label.azimuth, label.elevation, label.inplane) == pytest.approx(
            (pose.azimuth, pose.elevation, pose.inplane), abs=1e-9
        )
        assert (label.focal_px, label.principal_px) == (pose.focal_px, pose.principal_px)
        assert label.cad == part.cad.id
        assert label.cad_diagonal == pytest.approx(1000.0, rel=1e-6)
        np.testing.assert_allclose(label.R_cv_from_s or (), pose.R_cv_from_s, atol=1e-12)
        assert label.t_cv == (0.0, 0.0, 2000.0)
        assert label.cad_path is not None and label.cad_path.is_file()
        photo, _ = object_in_photo(label)
        assert mask_in_photo(label, photo) is not None


def test_objects_of_one_known_camera_share_an_image(made: Made, tmp_path: Path) -> None:
    document = made.documents[0]
    parts = [document.annotations[0], document.annotations[0]]
    shared = document.model_copy(update={"annotations": tuple(parts)})
    out = tmp_path / "set"
    sources = Sources(made.library.path, made.folder, photo_camera=True)
    export("bop", [shared, *made.documents[1:]], out, sources)
    poses = bop_toolkit.load_scene_gt(scene(out) / "scene_gt.json")
    cameras = bop_toolkit.load_scene_camera(scene(out) / "scene_camera.json")
    assert [len(objects) for objects in poses.values()] == [2, 1, 1]
    np.testing.assert_array_equal(cameras[0]["cam_K"], [[150, 0, 60], [0, 150, 40], [0, 0, 1]])
    whole = parts[0].pose_6dof
    assert whole is not None
    points = np.random.default_rng(0).uniform(-0.3, 0.3, (20, 3))
    gt = poses[0][1]
    pixels = cameras[0]["cam_K"] @ (gt["cam_R_m2c"] @ R_b_from_s @ (points.T * 1000.0) + gt["cam_t_m2c"])
    np.testing.assert_allclose((pixels[:2] / pixels[2]).T, whole.pose().project(points), atol=1e-6)
    assert list(documents_from("bop", out)) == [shared, *made.documents[1:3]]
    assert len(bop_toolkit.load_bop_results(out / "cadpose_annotations-test.csv")) == 4


def test_scenes_are_cut_between_photos(made: Made, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cadpose.annotations.formats.bop.SCENE", 3)
    out = made.export("bop", tmp_path / "set")
    counts = [len(bop_toolkit.load_scene_gt(path)) for path in sorted(out.glob("test/*/scene_gt.json"))]
    assert counts == [3, 1]
    assert list(documents_from("bop", out)) == list(made.documents[:3])


def edit_pose(folder: Path, **changes: Any) -> None:
    path = scene(folder) / "scene_gt.json"
    told = json.loads(path.read_text())
    told["2"][0] |= changes
    path.write_text(json.dumps(told))


def test_changed_poses_and_masks_count(made: Made, folder: Path) -> None:
    edit_pose(folder, cam_t_m2c=[0.0, 0.0, 3000.0])
    mask = np.zeros((61, 90), np.uint8)
    mask[5:9, 6:8] = 255
    Image.fromarray(mask).save(scene(folder) / "mask_visib" / "000002_000000.png")
    part = list(documents_from("bop", folder))[1].annotations[0]
    before = made.documents[1].annotations[0]
    assert part.pose.t_z == pytest.approx(3.0) and part.pose.azimuth == pytest.approx(before.pose.azimuth)
    assert part.detection.mask is not None and sum(part.detection.mask.counts[1::2]) == 8


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"cam_t_m2c": [10.0, 0.0, 2000.0]}, "off the optical axis"),
        ({"cam_t_m2c": [0.0, 0.0]}, "lacks its pose"),
        ({"obj_id": 1}, "obj_id was changed"),
        ({"cam_R_m2c": [2.0, 0, 0, 0, 1, 0, 0, 0, 1]}, "unusable pose: its rotation is not"),
    ],
)
def test_poses_that_cannot_be_taken_back(folder: Path, changes: dict[str, Any], words: str) -> None:
    edit_pose(folder, **changes)
    with pytest.raises(InputError, match=words):
        list(documents_from("bop", folder))


def test_a_mask_of_another_size(folder: Path) -> None:
    Image.new("L", (5, 5)).save(scene(folder) / "mask_visib" / "000002_000000.png")
    with pytest.raises(InputError, match="5 x 5 pixels and not 90 x 61"):
        list(documents_from("bop", folder))


def _document(made: Made, **changes: Any) -> Any:
    (annotation,) = made.documents[1].to_annotations()
    photo = replace(read_photo(made.folder / "b/street.png"), name="b/street.png")
    changed: Annotation = replace(annotation, **changes)
    return document_from(photo, [changed])


def test_models_that_are_missing_or_others(made: Made, tmp_path: Path) -> None:
    (annotation,) = made.documents[1].to_annotations()
    for cad, error, words in (
        (make_cad(1), LibraryError, "no CAD model"),
        (replace(annotation.cad, sha256="0" * 64), InputError, "not the one that was annotated"),
    ):
        document = _document(made, candidates=(replace(annotation.candidates[0], cad=cad),))
        with pytest.raises(error, match=words):
            export("bop", [document], tmp_path / "set", made.sources)
    assert list(tmp_path.iterdir()) == []


def test_known_sizes_give_millimetres(small_library: Library, tmp_path: Path) -> None:
    cad = replace(small_library.models("car")[0], size_cm=(30.0, 40.0, 120.0))
    models = BopModels(tmp_path, Sources(small_library.path))
    assert models.number(CadPart.of(cad)) == models.number(CadPart.of(cad)) == 1
    models.finish()
    (told,) = bop_toolkit.load_json(tmp_path / "models_info.json").values()
    assert told["metric"] is True and told["diagonal_mm"] == diagonal_mm(CadPart.of(cad)) == 1300.0
    assert np.linalg.norm([told[f"size_{a}"] for a in "xyz"]) == pytest.approx(1300.0)


def test_symmetries_are_written_in_the_models_axes(
    small_library: Library, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cad = CadPart.of(small_library.models("chair")[0])
    told = []
    for group in (SymmetryGroup.cyclic(2), SymmetryGroup.revolution(), SymmetryGroup.trivial()):
        monkeypatch.setattr(Library, "symmetry", lambda *_, group=group: group)
        models = BopModels(tmp_path, Sources(small_library.path))
        models.number(cad)
        models.finish()
        told.append(bop_toolkit.load_json(tmp_path / "models_info.json")[1])
    # Half a turn about the vertical axis, which is z in BOP.
    np.testing.assert_allclose(
        np.array(told[0]["symmetries_discrete"]).reshape(4, 4), np.diag([-1, -1, 1, 1]), atol=1e-12
    )
    np.testing.assert_allclose(told[1]["symmetries_continuous"][0]["axis"], [0, 0, 1], atol=1e-12)
    assert not [key for key in told[2] if key.startswith("symmetries")]
