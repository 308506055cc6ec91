"""The worker's photographs: an environment all around as the only light, and a ground that catches shadows.

Part of blender_worker.py, which loads it from beside itself; like that it imports nothing of cadpose.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

#: Largest environment in pixels: 8192 x 4096 and a little.
MAX_PIXELS = 36_000_000
#: Half the side of the ground, in model diagonals.
_GROUND = 6.0


class PhotoSet:
    """Turns a studio's scene into one lit by an environment, and back.

    Args:
        studio: The worker's Studio.
    """

    def __init__(self, studio: Any) -> None:
        self.studio = studio
        bpy = self.bpy = studio.bpy
        self.world = bpy.data.worlds.new("environment")
        self.world.use_nodes = True
        # Left to itself Cycles makes so fine a table of where light comes from that it takes seconds a view.
        self.world.cycles.sampling_method = "MANUAL"
        self.world.cycles.sample_map_resolution = 256
        nodes, links = self.world.node_tree.nodes, self.world.node_tree.links
        self.background = nodes["Background"]
        self.texture = nodes.new("ShaderNodeTexEnvironment")
        self.mapping = nodes.new("ShaderNodeMapping")
        coordinates = nodes.new("ShaderNodeTexCoord")
        links.new(coordinates.outputs["Generated"], self.mapping.inputs["Vector"])
        links.new(self.mapping.outputs[0], self.texture.inputs[0])
        links.new(self.texture.outputs[0], self.background.inputs[0])
        mesh = bpy.data.meshes.new("ground")
        s = _GROUND
        mesh.from_pydata([(-s, 0, -s), (s, 0, -s), (s, 0, s), (-s, 0, s)], [], [(0, 1, 2, 3)])
        self.ground = bpy.data.objects.new("ground", mesh)
        self.ground.is_shadow_catcher = True
        studio.scene.collection.objects.link(self.ground)
        self.ground.hide_render = True
        self.radiance = 1.0

    def light(self, path: str | None, pixels: Any) -> None:
        """Take an environment from a file, or from (H, W, 3) float32 linear light.

        Raises:
            ValueError: the file cannot be read, is too large or dark.
        """
        old = self.texture.image
        if path is not None:
            image = self.bpy.data.images.load(path)
            image.name = "environment"
            image.colorspace_settings.name = "Linear Rec.709"
        else:
            height, width = pixels.shape[:2]
            image = self.bpy.data.images.new("environment", width, height, float_buffer=True)
            image.colorspace_settings.name = "Non-Color"
            rgba = np.concatenate([pixels[::-1], np.ones_like(pixels[..., :1])], axis=-1)
            image.pixels.foreach_set(np.ascontiguousarray(rgba, np.float32).ravel())
            image.update()
        try:
            width, height = image.size
            if not 0 < width * height <= MAX_PIXELS:
                raise ValueError(f"an environment of {width} x {height} pixels cannot be used")
            flat = np.empty(width * height * image.channels, np.float32)
            image.pixels.foreach_get(flat)
            self.radiance = mean_radiance(flat.reshape(height, width, -1)[::-1, :, :3])
        except BaseException:
            self.bpy.data.images.remove(image)
            raise
        self.texture.image = image
        if old is not None:
            self.bpy.data.images.remove(old)

    def render(self, header: dict[str, Any]) -> dict[str, Any]:
        """Linear colour times alpha, alpha, and by how much the ground is darker for the object."""
        studio, scene = self.studio, self.studio.scene
        cycles, render, layer = scene.cycles, scene.render, scene.view_layers[0]
        self.mapping.inputs["Rotation"].default_value = (math.pi / 2.0, 0.0, header["turn"])
        self.background.inputs[1].default_value = header["exposure"] / self.radiance
        before = scene.world, cycles.samples, render.use_persistent_data
        # Persistent data makes a turned environment slower by seconds.
        scene.world, render.use_persistent_data = self.world, False
        for lamp, _ in studio.suns:
            lamp.hide_render = True
        try:
            channels = studio.channels(header["camera"])
            rgba = np.stack([channels[f"Combined.{c}"] for c in "RGBA"], axis=-1)
            out = {"rgb": rgba[..., :3], "alpha": rgba[..., 3]}
            if header["ground"] is not None:
                # Shadows are soft, and rays to the ground cost most: half the resolution, half the rays.
                self.ground.matrix_world = studio.matrix.Translation((0.0, header["ground"], 0.0))
                self.ground.hide_render, layer.cycles.use_pass_shadow_catcher = False, True
                cycles.samples = max(4, cycles.samples // 2)
                channels = studio.channels(_halved(header["camera"]))
                out["light"] = np.stack([channels[f"Shadow Catcher.{c}"] for c in "RGB"], axis=-1)
        finally:
            self.ground.hide_render, layer.cycles.use_pass_shadow_catcher = True, False
            for lamp, _ in studio.suns:
                lamp.hide_render = False
            scene.world, cycles.samples, render.use_persistent_data = before
        return out


def _halved(camera: dict[str, Any]) -> dict[str, Any]:
    """The camera for a picture of half the size, rounded up."""
    width, height = (camera["width"] + 1) // 2, (camera["height"] + 1) // 2
    cx, cy = camera["principal_px"]
    half = {"focal_px": camera["focal_px"] / 2.0, "principal_px": [cx / 2.0, cy / 2.0]}
    return {**camera, **half, "width": width, "height": height}


def mean_radiance(pixels: Any) -> float:
    """Mean luminance of the upper half of a (H, W, 3) environment, by solid angle.

    Raises:
        ValueError: it is dark or not finite.
    """
    upper = pixels[: max(1, len(pixels) // 2)].astype(np.float64)
    weight = np.cos(np.pi * (0.5 - (np.arange(len(upper)) + 0.5) / len(pixels)))
    rows = (upper @ np.array([0.2126, 0.7152, 0.0722])).mean(axis=1)
    mean = float((rows * weight).sum() / weight.sum())
    if not (math.isfinite(mean) and mean > 1e-6):
        raise ValueError("the environment gives no light from above")
    return mean
