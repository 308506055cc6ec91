"""Run by Blender's Python: what its importers make of scenes, as its own camera sees them.

Reads a JSON list of files on stdin; the last line of stdout is the answer.
"""

from __future__ import annotations

import json
import sys

import bpy
from bpy_extras.object_utils import world_to_camera_view


def seen(path: str) -> dict[str, object]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".glb"):
        bpy.ops.import_scene.gltf(filepath=path)
    else:
        bpy.ops.wm.usd_import(filepath=path)
    scene = bpy.context.scene
    scene.camera = next(found for found in scene.objects if found.type == "CAMERA")
    # The frame's width over its height is all that counts of the size.
    scene.render.resolution_x, scene.render.resolution_y = 1200, 800
    bpy.context.view_layer.update()
    shares = {}
    for found in scene.objects:
        if found.type == "MESH":
            names, at = [], found
            while at is not None:
                names.append(at.name)
                at = at.parent
            places = (found.matrix_world @ vertex.co for vertex in found.data.vertices)
            shares["/".join(reversed(names))] = [
                list(world_to_camera_view(scene, scene.camera, place))[:2] for place in places
            ]
    materials = sorted(material.name for material in bpy.data.materials)
    images = [image.size[0] for image in bpy.data.images if image.type == "IMAGE"]
    return {"shares": shares, "materials": materials, "images": images}


if __name__ == "__main__":
    sys.stdout.write("\n" + json.dumps([seen(path) for path in json.load(sys.stdin)]) + "\n")
