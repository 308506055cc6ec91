"""Every family of files that cadpose reads from strangers: right ones, and what reads them."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from PIL import Image

from cadpose.annotations.formats.registry import FORMATS, documents_from, export
from cadpose.annotations.formats.sources import Sources, documents_in
from cadpose.datasets.gallery import read_gallery
from cadpose.datasets.inert_pickle import read_object_array
from cadpose.datasets.labels import read_labels
from cadpose.datasets.matlab import read_struct
from cadpose.datasets.registry import open_dataset
from cadpose.detection.mask_png import read_masks
from cadpose.detection.onnx_head import read_head
from cadpose.detection.sources import open_detections
from cadpose.errors import InputError
from cadpose.intrinsics import Intrinsics
from cadpose.library.importing import import_item
from cadpose.library.loading import load_mesh_file
from cadpose.library.sweethome3d import sweethome3d_items
from cadpose.photos import read_photo
from cadpose.records import Photo
from cadpose.weights import REGISTRY, is_intact, location
from tests.annotations.factory import make_document
from tests.datasets import trees
from tests.detection import heads
from tests.fuzzing.running import Make, Target
from tests.library import builders

PHOTO = Photo(np.full((24, 32, 3), 120, np.uint8), "a.png")


def images(folder: Path) -> list[Target]:
    """Photos in every format that is read, with EXIF."""
    rng = np.random.default_rng(0)
    smooth = np.asarray(Image.fromarray(rng.integers(0, 255, (6, 8, 3), np.uint8)).resize((40, 30)))
    image = Image.fromarray(smooth)
    exif = image.getexif()
    exif[274], exif[41989] = 6, 50
    made = {
        "a.jpg": {"format": "JPEG", "exif": exif},
        "progressive.jpg": {"format": "JPEG", "progressive": True, "exif": exif},
        "a.png": {"format": "PNG", "exif": exif},
        "a.webp": {"format": "WEBP"},
        "a.tif": {"format": "TIFF"},
        "packed.tif": {"format": "TIFF", "compression": "tiff_lzw"},
        "a.bmp": {"format": "BMP"},
        "a.gif": {"format": "GIF"},
        "a.ppm": {"format": "PPM"},
        "a.jp2": {"format": "JPEG2000"},
        "a.avif": {"format": "AVIF"},
    }
    targets = []
    for name, options in made.items():
        out = io.BytesIO()
        image.save(out, **options)  # type: ignore[arg-type]
        targets.append(Target(folder / name, out.getvalue(), partial(read_photo, folder / name)))
    for mode in ("P", "L", "RGBA", "I;16", "1"):
        out, path = io.BytesIO(), folder / f"mode-{mode.replace(';', '')}.png"
        (Image.fromarray(smooth[..., 0].astype(np.uint16)) if mode == "I;16" else image.convert(mode)).save(
            out, "PNG"
        )
        targets.append(Target(path, out.getvalue(), partial(read_photo, path)))
    return targets


def masks(folder: Path) -> list[Target]:
    """PNG masks of a photo."""
    values = np.zeros((24, 32), np.uint8)
    values[4:12, 5:20], values[14:20, 8:30] = 1, 2
    targets = []
    for name, image in {
        "grey.png": Image.fromarray(values),
        "palette.png": Image.fromarray(values).convert("P"),
        "deep.png": Image.fromarray(values.astype(np.uint16)),
        "two.png": Image.fromarray(values > 0),
    }.items():
        out = io.BytesIO()
        image.save(out, "PNG")
        targets.append(Target(folder / name, out.getvalue(), partial(read_masks, folder / name, PHOTO)))
    return targets


def meshes(folder: Path) -> list[Target]:
    """OBJ with MTL and texture, GLB, glTF, PLY, STL."""
    box = trimesh.creation.box((1.0, 2.0, 3.0))
    header, binary = builders.triangle_gltf()
    apart = header | {"buffers": [{"byteLength": len(binary), "uri": "a.bin"}]}
    textured = trimesh.creation.box()
    visuals: Any = trimesh.visual.TextureVisuals
    textured.visual = visuals(
        uv=np.random.default_rng(0).random((len(textured.vertices), 2)),
        image=Image.new("RGB", (8, 8), (200, 40, 10)),
    )
    scene: Any = trimesh.Scene(textured)
    files: dict[str, tuple[bytes, str]] = {
        "square.obj": (builders.SQUARE.encode(), "square.obj"),
        "square.mtl": (b"newmtl paint\nKd 0.5 0.2 0.1\nd 0.9\nmap_Kd a.png\n", "square.obj"),
        "a.png": (builders.png(), "square.obj"),
        "cube.obj": (builders.CUBE.encode(), "cube.obj"),
        "triangle.glb": (builders.glb(header, binary), "triangle.glb"),
        "textured.glb": (bytes(scene.export(file_type="glb")), "textured.glb"),
        "triangle.gltf": (json.dumps(apart).encode(), "triangle.gltf"),
        "a.bin": (binary, "triangle.gltf"),
        "binary.ply": (bytes(box.export(file_type="ply")), "binary.ply"),
        "text.ply": (box.export(file_type="ply", encoding="ascii"), "text.ply"),
        "binary.stl": (bytes(box.export(file_type="stl")), "binary.stl"),
        "text.stl": (box.export(file_type="stl_ascii").encode(), "text.stl"),
    }
    for name, (data, _) in files.items():
        (folder / name).write_bytes(data)
    return [
        Target(folder / name, data, partial(load_mesh_file, folder / whole))
        for name, (data, whole) in files.items()
    ]


def archives(folder: Path) -> list[Target]:
    """Sweet Home 3D's libraries, which are ZIP files."""
    path = folder / "a.sh3f"
    model = {
        "id": "cad#1", "name": "Armchair", "category": "Living room", "model": "/a/square.obj",
        "width": "70", "depth": "80", "height": "90", "modelRotation": "1 0 0 0 1 0 0 0 1",
    }  # fmt: skip
    files = {"a/square.obj": builders.SQUARE.encode(), "a/square.mtl": b"newmtl paint\nKd 1 0 0\n"}
    builders.write_sh3f(path, [model, model | {"id": "cad#2", "model": "/a/none.obj"}], files)

    def read() -> None:
        for item in sweethome3d_items(path, [])[:3]:
            problem = import_item(item, str(folder / "meshes")).problem
            # The importer lets no model stop the others, whatever its reader raises; here that counts.
            if problem and "cannot be imported (" in problem:
                raise AssertionError(problem)

    return [Target(path, path.read_bytes(), read)]


def labels(folder: Path) -> list[Target]:
    """The published data sets' annotation files, and our own."""
    targets = []
    for kind, tree in (
        ("pix3d", trees.pix3d_tree),
        ("bop", trees.bop_tree),
        ("pascal3d", trees.pascal3d_tree),
    ):
        root = tree(folder / kind)
        for path in sorted(p for p in root.rglob("*") if p.suffix in {".json", ".mat"}):
            read = partial(_all_labels, kind, root)
            targets.append(Target(path, path.read_bytes(), read))
    ours = folder / "labels.jsonl"
    entry = {"photo": "a.png", "category": "car", "box": [1, 2, 20, 18], "azimuth": 30.0, "elevation": 5.0}
    ours.write_text(json.dumps(entry) + "\n" + json.dumps(entry | {"inplane": 2.0}) + "\n")
    gallery = folder / "gallery.json"
    gallery.write_text(json.dumps({"car": ["a", "b"], "chair": ["c"]}))
    targets.append(Target(ours, ours.read_bytes(), partial(read_labels, ours)))
    targets.append(Target(gallery, gallery.read_bytes(), partial(read_gallery, gallery)))
    return targets


def binary_labels(folder: Path) -> list[Target]:
    """MATLAB's files and NumPy's pickled arrays, which are read without running them."""
    mat, npz = folder / "a.mat", folder / "a.npz"
    trees.write_mat(mat, [trees.thing(), trees.thing(**{"class": "chair"})])
    trees.write_npz(npz, [trees.pose(), trees.pose()])
    with np.load(npz, allow_pickle=False) as held:
        name = held.files[0]
    return [
        Target(mat, mat.read_bytes(), partial(read_struct, mat, "record")),
        Target(npz, npz.read_bytes(), partial(read_object_array, npz, name)),
    ]


def detections(folder: Path) -> list[Target]:
    """COCO and Label Studio as boxes for a photo, descriptions of detectors, cameras."""
    coco = {
        "images": [{"id": 1, "file_name": "a.png", "width": 32, "height": 24}],
        "categories": [{"id": 3, "name": "car"}],
        "annotations": [
            {"id": 1, "image_id": 1, "category_id": 3, "bbox": [2, 3, 20, 12], "score": 0.5,
             "segmentation": [[2, 3, 20, 3, 20, 15, 2, 15]]},
            {"id": 2, "image_id": 1, "category_id": 3, "bbox": [2, 3, 20, 12],
             "segmentation": {"size": [24, 32], "counts": [100, 20, 648]}},
        ],
    }  # fmt: skip
    studio = [
        {
            "data": {"image": "/data/upload/a.png"},
            "annotations": [
                {
                    "result": [
                        {
                            "type": "rectanglelabels", "original_width": 32, "original_height": 24,
                            "value": {"x": 10, "y": 10, "width": 50, "height": 50, "rotation": 0,
                                      "rectanglelabels": ["car"]},
                        },
                        {
                            "type": "polygonlabels", "original_width": 32, "original_height": 24,
                            "value": {"points": [[10, 10], [60, 10], [60, 60]], "polygonlabels": ["car"]},
                        },
                    ]
                }
            ],
        }
    ]  # fmt: skip
    cameras = {"a.png": {"focal_px": 800.0, "principal_px": [16.0, 12.0]}}
    files: dict[str, tuple[object, Callable[[Path], object]]] = {
        "coco.json": (coco, lambda path: open_detections(path).detect(PHOTO)),
        "studio.json": (studio, lambda path: open_detections(path).detect(PHOTO)),
        "head.json": (heads.described(), read_head),
        "cameras.json": (cameras, lambda path: Intrinsics.from_text(str(path)).camera_of(PHOTO)),
    }
    targets = []
    for name, (value, read) in files.items():
        data = json.dumps(value).encode()
        targets.append(Target(folder / name, data, partial(read, folder / name)))
    return targets


def documents(folder: Path) -> list[Target]:
    """Our documents, and what `cadpose import` reads."""
    document = make_document("a.png", annotations=2)
    path = folder / "a.json"
    targets = [Target(path, document.to_json().encode(), lambda: list(documents_in([path])))]
    photos = folder / "photos"
    photos.mkdir()
    for name in ("coco", "label-studio", "csv"):
        kind = FORMATS[name]
        out = folder / f"{name}.out"
        export(name, [document], out, Sources(None, photos))
        files = (
            [out] if not kind.folder else sorted(p for p in out.rglob("*") if p.suffix in {".json", ".csv"})
        )
        targets += [Target(file, file.read_bytes(), partial(_all_documents, name, out)) for file in files]
    return targets


def weights(folder: Path) -> list[Target]:
    """Shipped networks: whatever is changed must be refused before it is opened."""
    named = min((w for w in REGISTRY.values() if location(w)), key=lambda w: w.size)
    path = folder / named.file.rsplit("/", 1)[-1]
    source = location(named)
    assert source is not None
    whole = source.read_bytes()

    def read() -> None:
        same = path.read_bytes() == whole
        if is_intact(named, path) != same:
            raise AssertionError("a changed file passed for the network, or the network for a changed file")
        if not same:
            raise InputError(f"{path} is not the file it should be")

    return [Target(path, whole, read)]


def _all_labels(kind: str, root: Path) -> None:
    for label in open_dataset(kind, root):
        replace(label)


def _all_documents(name: str, path: Path) -> None:
    for _ in documents_from(name, path):
        pass


FAMILIES: dict[str, Make] = {
    make.__name__: make
    for make in (
        images, masks, meshes, archives, labels, binary_labels, detections, documents, weights,
    )
}  # fmt: skip
