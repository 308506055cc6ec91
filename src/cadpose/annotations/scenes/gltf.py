"""A photo's scene as one binary glTF file (.glb), and the annotations read back from one."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from cadpose.annotations.document import MAX_CHARACTERS, AnnotationDocument
from cadpose.annotations.files import write_atomic
from cadpose.annotations.scenes.contents import Meshes, SceneContents, gather
from cadpose.annotations.scenes.extras import GENERATOR, KEY, credits, model_extras, photo_title, unit_told
from cadpose.annotations.scenes.glb import GlbBuilder, read_header
from cadpose.annotations.scenes.gltf_meshes import SAMPLERS, MeshWriter
from cadpose.annotations.scenes.layout import PlacedModel, Placement, turns_and_scales
from cadpose.annotations.scenes.shades import lamps
from cadpose.annotations.scenes.turns import quaternion
from cadpose.errors import InputError
from cadpose.records import Photo


def write_gltf_scene(
    document: AnnotationDocument,
    library: Meshes,
    photo: Photo,
    path: str | os.PathLike[str],
    *,
    placement: Placement = "overlay",
) -> None:
    """Write the scene of one photo, whole or not at all.

    Args:
        document: The photo's annotations.
        library: The library that their CAD models are in.
        photo: The photo itself.
        path: Of the .glb file; its folder is made.
        placement: ``"overlay"``: models on the annotation's pixels; ``"rigid"``: models undistorted.

    Raises:
        InputError: the photo is not the document's, or an annotation cannot be placed.
        LibraryError: a model is not in the library, or its file is damaged.
        CadposeError: the file cannot be written.
    """
    write_atomic(path, gltf_scene(document, library, photo, placement=placement))


def gltf_scene(
    document: AnnotationDocument, library: Meshes, photo: Photo, *, placement: Placement = "overlay"
) -> bytes:
    """As `write_gltf_scene`, the file's bytes."""
    return _Writer(gather(document, library, photo, placement, centred=True)).to_bytes()


def read_gltf_scene(path: str | os.PathLike[str]) -> AnnotationDocument:
    """The annotations that a .glb of `write_gltf_scene` carries.

    Raises:
        InputError: it is no such file, or the document in it is not valid.
    """
    try:
        with Path(path).open("rb") as file:
            header = read_header(file, 2 * MAX_CHARACTERS)
        told = header["scenes"][header.get("scene", 0)]["extras"][KEY]
    except OSError as error:
        raise InputError(f"{path} cannot be read: {error.strerror or error}") from None
    except (ValueError, KeyError, IndexError, TypeError) as error:
        fault = str(error) if isinstance(error, ValueError) else "it carries no annotations"
        raise InputError(f"{path} is no scene that cadpose exported: {fault}") from None
    return AnnotationDocument.from_json(json.dumps(told), str(path))


@dataclass
class _Writer:
    contents: SceneContents
    _meshes: dict[str, int] = field(default_factory=dict)

    def to_bytes(self) -> bytes:
        document, layout = self.contents.document, self.contents.layout
        self.glb = GlbBuilder(
            {
                "asset": {"version": "2.0", "generator": GENERATOR, "copyright": credits(document)},
                "extensionsUsed": ["KHR_lights_punctual", "KHR_materials_unlit"],
                "scene": 0,
                "samplers": list(SAMPLERS),
            }
        )
        self.writer = MeshWriter(self.glb)
        nodes = [self._camera(), self._backdrop(), *self._lights(), *map(self._model, layout.models)]
        extras = {
            KEY: document.model_dump(mode="json", by_alias=True),
            f"{KEY}_unit": unit_told(layout.models),
        }
        self.glb.add("scenes", {"name": photo_title(document), "nodes": nodes, "extras": extras})
        return self.glb.to_bytes()

    def _camera(self) -> int:
        camera = self.contents.layout.camera
        lens = {
            "yfov": 2.0 * math.atan(camera.height / (2.0 * camera.focal_px)),
            "aspectRatio": camera.width / camera.height,
            "znear": camera.near,
            "zfar": camera.far,
        }
        number = self.glb.add("cameras", {"name": "photo camera", "type": "perspective", "perspective": lens})
        extras = {"focal_px": camera.focal_px, "photo_size": [camera.width, camera.height]}
        return self.glb.add("nodes", {"name": "photo camera", "camera": number, "extras": {KEY: extras}})

    def _backdrop(self) -> int:
        glb = self.glb
        image = glb.blob(self.contents.photo_jpeg)
        picture = glb.add("images", {"name": "photo", "mimeType": "image/jpeg", "bufferView": image})
        texture = glb.add("textures", {"source": picture, "sampler": 1})
        material = glb.add(
            "materials",
            {
                "name": "photo",
                "pbrMetallicRoughness": {
                    "baseColorTexture": {"index": texture},
                    "metallicFactor": 0.0,
                    "roughnessFactor": 1.0,
                },
                "extensions": {"KHR_materials_unlit": {}},
            },
        )
        uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0)], np.float32)
        corners = self.contents.layout.backdrop.astype(np.float32)
        primitive = {
            "attributes": {"POSITION": glb.vectors(corners, bounds=True), "TEXCOORD_0": glb.vectors(uv)},
            "indices": glb.indices(np.array([(0, 1, 2), (0, 2, 3)], np.uint32)),
            "material": material,
        }
        mesh = glb.add("meshes", {"name": "photo", "primitives": [primitive]})
        return glb.add("nodes", {"name": "photo", "mesh": mesh})

    def _lights(self) -> list[int]:
        told = []
        nodes = []
        for number, lamp in enumerate(lamps()):
            # Lux: a white surface that faces pi lux shows as white.
            told.append({"name": lamp.name, "type": "directional", "intensity": math.pi * lamp.strength})
            node = {
                "name": lamp.name,
                "rotation": quaternion(lamp.turn()),
                "extensions": {"KHR_lights_punctual": {"light": number}},
            }
            nodes.append(self.glb.add("nodes", node))
        self.glb.header["extensions"] = {"KHR_lights_punctual": {"lights": told}}
        return nodes

    def _model(self, model: PlacedModel) -> int:
        outer, scales, inner = turns_and_scales(model.T_scene_from_s)
        name = f"{model.number + 1} {model.annotation.cad.name or model.annotation.cad.id}"
        mesh = self._mesh(model.annotation.cad.id)
        # A single node may turn and scale, but only two of them lean: docs/export-scenes.md.
        body = self.glb.add("nodes", {"name": f"{name}: model", "mesh": mesh, "rotation": quaternion(inner)})
        return self.glb.add(
            "nodes",
            {
                "name": name,
                "translation": model.T_scene_from_s[:3, 3].tolist(),
                "rotation": quaternion(outer),
                "scale": scales.tolist(),
                "children": [body],
                "extras": {KEY: model_extras(model)},
            },
        )

    def _mesh(self, cad_id: str) -> int:
        if cad_id not in self._meshes:
            self._meshes[cad_id] = self.writer.mesh(cad_id, self.contents.pieces[cad_id])
        return self._meshes[cad_id]
