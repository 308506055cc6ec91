"""FiftyOne's .fo3d scenes: one model before the annotation's camera."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Self
from uuid import UUID

import numpy as np

from cadpose.annotations.annotation_part import AnnotationPart
from cadpose.annotations.document import AnnotationDocument
from cadpose.annotations.formats.fiftyone_schema import dataset_document
from cadpose.annotations.formats.json_stream import JsonArrays, dumped
from cadpose.annotations.formats.ply import ply_bytes
from cadpose.annotations.formats.sources import Sources
from cadpose.annotations.formats.target import file_stem
from cadpose.annotations.formats.views import View, view_of
from cadpose.annotations.scenes.turns import quaternion
from cadpose.geometry.frames import R_gl_from_cv
from cadpose.library.storage import sha256_of


class SceneFolder:
    """Writes a FiftyOneDataset of scenes: metadata.json, samples.json, data and the models.

    Args:
        folder: Where; it is made.
        sources: Gives the meshes.
    """

    def __init__(self, folder: Path, sources: Sources) -> None:
        (folder / "data").mkdir(parents=True)
        (folder / "models").mkdir()
        self._folder, self._sources = folder, sources
        self._models: set[str] = set()
        self._samples = JsonArrays(folder / "samples.json", ["samples"])
        text = dumped(dataset_document("3d", None))
        (folder / "metadata.json").write_text(text + "\n", encoding="utf-8")

    def __enter__(self) -> Self:
        self._samples.__enter__()
        return self

    def __exit__(self, kind: type[BaseException] | None, *error: object) -> None:
        self._samples.__exit__(kind, *error)

    def add(self, document: AnnotationDocument, part: AnnotationPart, number: int) -> str:
        """Write an object's scene; returns its path relative to the folder above."""
        model = f"{sha256_of(part.cad.id.encode())[:16]}.ply"
        if model not in self._models:
            mesh = self._sources.mesh(part.cad)
            (self._folder / "models" / model).write_bytes(ply_bytes(mesh))
            self._models.add(model)
        name = f"{file_stem(document)}-{number:03d}.fo3d"
        told = scene(part, view_of(part, False), document.photo.size, f"../models/{model}")
        path = self._folder / "data" / name
        path.write_text(dumped(told) + "\n", encoding="utf-8")
        digest = sha256_of(f"{document.photo.sha256}:{number}:scene".encode())
        self._samples.add(
            "samples",
            {
                "_id": {"$oid": digest[:24]},
                "filepath": f"data/{name}",
                "tags": [],
                "metadata": None,
                "_media_type": "3d",
                "_rand": int(digest[:8], 16) / 2**32,
                "photo_name": document.photo.name,
            },
        )
        return f"scenes/data/{name}"


def scene(part: AnnotationPart, view: View, size: tuple[int, int], model: str) -> dict[str, Any]:
    """A scene as FiftyOne writes it.

    The camera stands at the origin, looks along -z, y up (OpenGL's axes); .fo3d knows no principal point, so
    the model appears in the middle.

    Args:
        part: What is shown.
        view: How it stands.
        size: (width, height) of the photo.
        model: Path of its PLY file, in model diagonals.
    """
    width, height = size
    key = UUID(sha256_of(f"{part.cad.id}{view.t_cv.tolist()}{view.R_cv_from_s.tolist()}".encode())[:32])
    position = R_gl_from_cv @ view.t_cv
    placed = {
        "_type": "PlyMesh",
        "uuid": str(UUID(int=key.int ^ 1)),
        "name": part.cad.name or part.cad.id,
        "visible": True,
        "position": position.tolist(),
        "quaternion": quaternion(R_gl_from_cv @ view.R_cv_from_s),
        "scale": [1.0, 1.0, 1.0],
        "children": [],
        "defaultMaterial": {
            "_type": "MeshStandardMaterial",
            "opacity": 1.0,
            "wireframe": False,
            "color": "#808080",
            "emissiveColor": "#000000",
            "emissiveIntensity": 0.0,
            "metalness": 0.0,
            "roughness": 1.0,
        },
        "centerGeometry": False,
        "plyPath": model,
        "isPointCloud": False,
    }
    return {
        "_type": "Scene",
        "uuid": str(key),
        "name": "Scene",
        "visible": True,
        "position": [0.0, 0.0, 0.0],
        "quaternion": [0.0, 0.0, 0.0, 1.0],
        "scale": [1.0, 1.0, 1.0],
        "children": [placed],
        "__FO3D_VERSION": "1.0",
        "camera": {
            "position": [0.0, 0.0, 0.0],
            "lookAt": position.tolist(),
            "aspect": width / height,
            "up": "Y",
            "fov": float(np.rad2deg(2.0 * np.arctan(height / (2.0 * view.focal_px)))),
            "near": 0.01,
            "far": 2000.0,
        },
        "lights": None,
        "background": None,
    }
