"""Miniature data sets in the published file formats."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from cadpose.datasets.label import Label
from cadpose.geometry.frames import FloatArray

EMPTY = np.zeros((0, 0))
YES, NO = np.array([[1]], np.uint8), np.array([[0]], np.uint8)
#: What MATLAB writes beside the fields that are read.
VIEW: dict[str, Any] = {
    "azimuth_coarse": 100.0, "elevation_coarse": 0.0, "azimuth": 95.5, "elevation": 12.25, "distance": 5.5,
    "focal": 1.0, "px": 60.0, "py": 40.0, "theta": -3.5, "error": 1.5, "interval_azimuth": 4.0,
    "interval_elevation": 2.0, "num_anchor": 8.0, "viewport": 3000.0,
}  # fmt: skip
ANCHORS: dict[str, Any] = {"left_front_wheel": {"location": np.array([[10.0, 20.0]]), "status": 1.0}}


def camera_rotation(label: Label) -> FloatArray:
    """``R_cv_from_s`` as an array."""
    assert label.R_cv_from_s is not None
    return np.array(label.R_cv_from_s)


def view(**changes: Any) -> dict[str, Any]:
    """A viewpoint; None takes a field out."""
    return {key: value for key, value in (VIEW | changes).items() if value is not None}


def thing(**changes: Any) -> dict[str, Any]:
    """One object as PASCAL3D+ annotates it."""
    usual: dict[str, Any] = {
        "class": "car", "view": "", "bbox": np.array([[11.0, 21.0, 110.0, 70.0]]), "bndbox": EMPTY,
        "polygon": EMPTY, "difficult": NO, "truncated": NO,
        "occluded": NO, "anchors": ANCHORS, "viewpoint": view(), "cad_index": 3.0,
    }  # fmt: skip
    return {key: value for key, value in (usual | changes).items() if value is not None}


def write_mat(path: Path, things: Sequence[dict[str, Any]], **fields: Any) -> None:
    """A .mat file as MATLAB saves it: a 1 x 1 struct ``record`` with a 1 x N struct array ``objects``."""
    import scipy.io

    names = list(things[0]) if things else ["class"]
    objects = np.zeros((1, len(things)), [(name, object) for name in names])
    for i, item in enumerate(things):
        for name in names:
            objects[0, i][name] = item[name]
    record: dict[str, Any] = {
        "folder": "VOC2012",
        "filename": f"{path.stem}.jpg",
        "imgsize": np.array([[120.0, 80.0, 3.0]]),
    }
    record |= {"segmented": 0.0, "objects": objects, **fields}
    path.parent.mkdir(parents=True, exist_ok=True)
    scipy.io.savemat(path, {"record": record}, do_compression=True, oned_as="row")


def write_photo(path: Path, size: tuple[int, int] = (120, 80)) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", size, (90, 120, 150)).save(path, "PNG" if path.suffix == ".png" else "JPEG")


def write_text(path: Path, *lines: str) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in lines), encoding="utf-8")


def pascal3d_tree(root: Path) -> Path:
    """Two photos of PASCAL VOC, one of them held out, and one of ImageNet."""
    lists = root / "PASCAL" / "VOCdevkit" / "VOC2012" / "ImageSets" / "Main"
    write_text(lists / "car_train.txt", "2008_000001  1")
    write_text(lists / "car_val.txt", "2008_000002  1", "2008_000009 -1", "2008_000010  0")
    for folder, name, ending in (
        ("car_pascal", "2008_000001", "jpg"),
        ("car_pascal", "2008_000002", "jpg"),
        ("car_imagenet", "n02814533_10", "JPEG"),
    ):
        write_photo(root / "Images" / folder / f"{name}.{ending}")
        write_mat(root / "Annotations" / folder / f"{name}.mat", [thing()])
    return root


def objectnet3d_tree(root: Path) -> Path:
    """A photo a split; the list of the training split names one more that nobody annotated."""
    for split, name in (("train", "n1_1"), ("val", "n1_2"), ("test", "n1_3")):
        write_text(root / "Image_sets" / f"{split}.txt", name, *(["n1_99"] if split == "train" else []))
        write_photo(root / "Images" / f"{name}.JPEG")
        things = [
            thing(**{"class": "filing_cabinet", "viewpoint": view(azimuth=-30.0)}),
            thing(**{"class": "ashtray"}),
        ]
        write_mat(root / "Annotations" / f"{name}.mat", things)
    return root


PIX3D: dict[str, Any] = {
    "img": "img/bed/0001.png", "category": "bed", "img_size": [120, 80], "mask": "mask/bed/0001.png",
    "model": "model/bed/IKEA_MALM_2/model.obj", "rot_mat": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "trans_mat": [0.4, 0.1, 2.0], "focal_length": 32.0, "cam_position": [-0.4, -0.1, -2.0],
    "inplane_rotation": 0.0, "truncated": False, "occluded": False, "slightly_occluded": False,
    "bbox": [10, 20, 70, 60], "img_source": "ikea", "voxel": "model/bed/IKEA_MALM_2/voxel.mat",
}  # fmt: skip


def pix3d_tree(root: Path, *entries: dict[str, Any]) -> Path:
    root.mkdir(parents=True, exist_ok=True)
    (root / "pix3d.json").write_text(json.dumps([PIX3D | entry for entry in entries or ({},)]))
    write_photo(root / "img" / "bed" / "0001.png")
    mask = np.zeros((80, 120), np.uint8)
    mask[20:60, 10:70] = 255
    (root / "mask" / "bed").mkdir(parents=True, exist_ok=True)
    Image.fromarray(mask).save(root / "mask" / "bed" / "0001.png")
    return root


def pose(**changes: Any) -> dict[str, Any]:
    """One object as ImageNet3D annotates it: NumPy's numbers and Python's beside each other."""
    usual: dict[str, Any] = {
        "azimuth": np.float64(np.pi / 2), "elevation": 2 * np.pi - 0.1, "theta": 0.2, "cad_index": 2,
        "distance": np.float32(4.0), "viewport": 2000, "focal": 1, "height": np.uint16(80),
        "width": np.uint16(120), "bbox": np.array([10.0, 20.0, 70.0, 60.0]), "class": "bed", "px": 41.5,
        "py": 39.0, "principal": np.array([[41.5, 39.0]]), "object_status": "status_good",
        "dense": "dense_no",
    }  # fmt: skip
    return {key: value for key, value in (usual | changes).items() if value is not None}


def write_npz(path: Path, poses: Sequence[dict[str, Any]]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    # A list of dicts becomes an array of objects, which NumPy stores as a pickle.
    np.savez(path, annotations=np.array(list(poses)))


def imagenet3d_tree(root: Path, *poses: dict[str, Any]) -> Path:
    for split, name in (("train", "n02818832_13"), ("val", "n02818832_14")):
        write_text(root / "lists" / f"bed_imagenet_{split}.txt", name)
        write_photo(root / "images" / "bed" / f"{name}.JPEG")
        write_npz(root / "annotations" / "bed" / f"{name}.npz", poses or [pose()])
    return root


BOP_POSE: dict[str, Any] = {
    "cam_R_m2c": [0.0, 0.6, 0.8, 1.0, 0.0, 0.0, 0.0, 0.8, -0.6],
    "cam_t_m2c": [40.0, -10.0, 500.0],
    "obj_id": 5,
}


def bop_tree(root: Path, **changes: Any) -> Path:
    """A test photo with two objects, the second hardly visible, and a training photo with one."""
    size = {f"size_{axis}": length for axis, length in zip("xyz", (100.0, 40.0, 60.0), strict=True)}
    write_json(root / "models" / "models_info.json", {"5": {"diameter": 110.0, **size}})
    seen = {"bbox_visib": [10, 20, 60, 40], "bbox_obj": [10, 20, 60, 40], "visib_fract": 1.0}
    hidden = {"bbox_visib": [0, 0, 3, 3], "bbox_obj": [0, 0, 50, 50], "visib_fract": 0.01}
    for split, scene, image, objects in (("test", 48, 1, [seen, hidden]), ("train_pbr", 0, 7, [seen])):
        folder = root / split / f"{scene:06d}"
        poses = [BOP_POSE | (changes if i == 0 else {}) for i in range(len(objects))]
        write_json(folder / "scene_gt.json", {str(image): poses})
        write_json(folder / "scene_gt_info.json", {str(image): objects})
        K = [150.0, 0.0, 60.0, 0.0, 150.0, 40.0, 0.0, 0.0, 1.0]
        write_json(folder / "scene_camera.json", {str(image): {"cam_K": K, "depth_scale": 0.1}})
        write_photo(folder / "rgb" / f"{image:06d}.png")
        mask = np.zeros((80, 120), np.uint8)
        mask[20:60, 10:70] = 255
        (folder / "mask_visib").mkdir()
        Image.fromarray(mask).save(folder / "mask_visib" / f"{image:06d}_000000.png")
    return root


def write_json(path: Path, value: Any) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(value))
