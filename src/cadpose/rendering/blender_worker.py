"""The process that draws with Blender: run by the Python of Blender's own virtualenv, never by ours.

It needs numpy and bpy only and imports nothing of cadpose; cadpose imports the message functions from here
and never bpy. Requests come on standard input, answers go to standard output: a 4-byte big-endian length, a
JSON object, then the arrays that the object's ``arrays`` list names, raw. It ends with its input.

Object coordinates (ShapeNet axes) serve as Blender's world; lights turn with the camera, as in shading.py.
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
import os
import struct
import sys
import tempfile
from pathlib import Path
from typing import IO, Any

import numpy as np

MAX_HEADER = 1 << 24
MAX_ARRAY = 1 << 32

# As in shading.py: directions towards the lights (x right, y down, z forward), then their strength.
KEY = (-0.48, -0.62, -0.62, 0.72)
FILL = (0.80, -0.15, -0.58, 0.22)
AMBIENT = 0.26


def write_message(stream: IO[bytes], header: dict[str, Any], arrays: dict[str, Any] | None = None) -> None:
    """Send a JSON object and named arrays."""
    packed = {name: np.ascontiguousarray(array) for name, array in (arrays or {}).items()}
    spec = [{"name": k, "dtype": a.dtype.str, "shape": list(a.shape)} for k, a in packed.items()]
    data = json.dumps({**header, "arrays": spec}).encode()
    stream.write(struct.pack(">I", len(data)) + data)
    for array in packed.values():
        stream.write(array.tobytes())
    stream.flush()


def read_message(stream: IO[bytes]) -> tuple[dict[str, Any], dict[str, Any]] | None:
    """Receive what write_message sent; None at the end of the stream.

    Raises:
        ValueError: a length is beyond the limits or the stream ends within a message.
    """
    start = stream.read(4)
    if not start:
        return None
    (length,) = struct.unpack(">I", start)
    if length > MAX_HEADER:
        raise ValueError("message header too long")
    header = json.loads(_exactly(stream, length))
    arrays = {}
    for spec in header.pop("arrays"):
        dtype, shape = np.dtype(spec["dtype"]), tuple(int(n) for n in spec["shape"])
        size = math.prod(shape) * dtype.itemsize
        if dtype.hasobject or not 0 <= size <= MAX_ARRAY:
            raise ValueError("array refused")
        arrays[spec["name"]] = np.frombuffer(_exactly(stream, size), dtype).reshape(shape)
    return header, arrays


def _exactly(stream: IO[bytes], size: int) -> bytes:
    data = stream.read(size)
    if len(data) != size:
        raise ValueError("the stream ended within a message")
    return data


def to_linear(srgb: Any) -> Any:
    """SRGB in [0, 1] to linear light."""
    srgb = np.asarray(srgb, np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_srgb(linear: Any) -> Any:
    """Linear light to sRGB in [0, 1]."""
    linear = np.clip(np.asarray(linear, np.float64), 0.0, 1.0)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


def read_exr(data: bytes) -> dict[str, Any]:
    """Channels of an uncompressed, single-part, scan-line OpenEXR file, by name; (H, W) float32 each.

    Raises:
        ValueError: the file is of another kind.
    """
    magic, version = struct.unpack_from("<ii", data)
    if magic != 20000630 or version & 0x1A00:
        raise ValueError("not a plain scan-line OpenEXR file")
    at, attributes = 8, {}
    while data[at]:
        end = data.index(0, at)
        kind_end = data.index(0, end + 1)
        (size,) = struct.unpack_from("<i", data, kind_end + 1)
        attributes[data[at:end]] = data[kind_end + 5 : kind_end + 5 + size]
        at = kind_end + 5 + size
    if attributes[b"compression"] != b"\0":
        raise ValueError("the OpenEXR file is compressed")
    x0, y0, x1, y1 = struct.unpack("<iiii", attributes[b"dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    channels, kinds, i = [], [], 0
    table = attributes[b"channels"]
    while table[i]:
        end = table.index(0, i)
        channels.append(table[i:end].decode())
        kinds.append(np.dtype({0: "<u4", 1: "<f2", 2: "<f4"}[struct.unpack_from("<i", table, end + 1)[0]]))
        i = end + 17
    line = sum(kind.itemsize for kind in kinds) * width
    out = {name: np.empty((height, width), np.float32) for name in channels}
    for offset in np.frombuffer(data, "<u8", height, at + 1):
        y, size = struct.unpack_from("<ii", data, int(offset))
        if size != line:
            raise ValueError("unexpected OpenEXR line length")
        start = int(offset) + 8
        for name, kind in zip(channels, kinds, strict=True):
            out[name][y - y0] = np.frombuffer(data, kind, width, start)
            start += kind.itemsize * width
    return out


class Studio:
    """One Blender scene: a mesh at the origin, a camera, two suns and a grey world."""

    def __init__(self, bpy: Any, samples: int, denoise: bool, threads: int) -> None:
        self.bpy = bpy
        self.matrix = importlib.import_module("mathutils").Matrix
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.device = "CPU"
        scene.cycles.samples = samples
        scene.cycles.use_adaptive_sampling = False
        scene.cycles.use_denoising = denoise
        if denoise:
            # The denoiser is most of the cost of few samples: fast, no prefilter, colour alone.
            scene.cycles.denoiser = "OPENIMAGEDENOISE"
            scene.cycles.denoising_quality = "FAST"
            scene.cycles.denoising_prefilter = "NONE"
            scene.cycles.denoising_input_passes = "RGB"
        scene.cycles.seed = 0
        scene.cycles.max_bounces = 4
        scene.cycles.diffuse_bounces = 1
        scene.cycles.film_transparent_glass = False
        scene.cycles.filter_width = 1.0
        scene.cycles.pixel_filter_type = "BOX"
        scene.render.film_transparent = True
        scene.render.use_persistent_data = True
        scene.render.resolution_percentage = 100
        if threads > 0:
            scene.render.threads_mode, scene.render.threads = "FIXED", threads
        scene.view_layers[0].use_pass_z = True
        settings = scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        settings.color_depth, settings.exr_codec = "32", "NONE"
        if hasattr(settings, "use_exr_interleave"):
            settings.use_exr_interleave = True
        world = bpy.data.worlds.new("world")
        world.use_nodes = True
        world.node_tree.nodes["Background"].inputs[0].default_value = (AMBIENT, AMBIENT, AMBIENT, 1.0)
        scene.world = world
        self.camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
        self.camera.data.sensor_fit = "HORIZONTAL"
        self.camera.data.sensor_width = 36.0
        scene.collection.objects.link(self.camera)
        scene.camera = self.camera
        self.suns = [self._sun(*light) for light in (KEY, FILL)]
        self.object: Any = None
        self.folder = tempfile.TemporaryDirectory(prefix="cadpose-blender-")

    def _sun(self, x: float, y: float, z: float, strength: float) -> tuple[Any, Any]:
        lamp = self.bpy.data.objects.new("sun", self.bpy.data.lights.new("sun", "SUN"))
        lamp.data.energy = math.pi * strength
        lamp.data.angle = math.radians(10.0)
        self.scene.collection.objects.link(lamp)
        # A sun shines along its -z: its +z points towards the light.
        towards = np.array([x, y, z]) / np.linalg.norm([x, y, z])
        side = np.cross([0.0, 1.0, 0.0], towards)
        side /= np.linalg.norm(side)
        return lamp, np.stack([side, np.cross(towards, side), towards], axis=1)

    def load(self, header: dict[str, Any], arrays: dict[str, Any]) -> None:
        """Replace the mesh."""
        bpy = self.bpy
        # Cycles knows a texture it has kept by its address. The old ones go only when the new ones are there,
        # so that none of those takes an old one's place and is drawn with its pixels.
        # An environment, named otherwise, stays.
        textures = [image for image in bpy.data.images if image.name.startswith("texture")]
        old = [(bpy.data.materials, list(bpy.data.materials)), (bpy.data.images, textures)]
        if self.object is not None:
            mesh = self.object.data
            bpy.data.objects.remove(self.object)
            bpy.data.meshes.remove(mesh)
        vertices, faces = arrays["vertices"], arrays["faces"]
        mesh = bpy.data.meshes.new("mesh")
        mesh.vertices.add(len(vertices))
        mesh.vertices.foreach_set("co", vertices.ravel())
        mesh.loops.add(faces.size)
        mesh.loops.foreach_set("vertex_index", faces.ravel())
        mesh.polygons.add(len(faces))
        mesh.polygons.foreach_set("loop_start", np.arange(0, faces.size, 3, dtype=np.int32))
        mesh.polygons.foreach_set("material_index", arrays["face_material"])
        mesh.polygons.foreach_set("use_smooth", np.ones(len(faces), np.int8).astype(bool))
        mesh.uv_layers.new(name="uv").data.foreach_set("uv", arrays["corner_uv"].ravel())
        mesh.update(calc_edges=True)
        mesh.normals_split_custom_set(arrays["corner_normals"].reshape(-1, 3))
        for i, spec in enumerate(header["materials"]):
            mesh.materials.append(self._material(spec, arrays.get(f"texture{i}")))
        self.object = bpy.data.objects.new("object", mesh)
        self.scene.collection.objects.link(self.object)
        for data, items in old:
            for item in items:
                data.remove(item)

    def _material(self, spec: dict[str, Any], texture: Any) -> Any:
        bpy = self.bpy
        material = bpy.data.materials.new("material")
        material.use_nodes = True
        nodes, links = material.node_tree.nodes, material.node_tree.links
        nodes.clear()
        output = nodes.new("ShaderNodeOutputMaterial")
        if spec["kind"] == "invisible":
            links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], output.inputs[0])
            return material
        rgb, alpha = to_linear(spec["rgba"][:3]).tolist(), float(spec["rgba"][3])
        if "roughness" in spec:
            surface, colour = nodes.new("ShaderNodeBsdfPrincipled"), "Base Color"
            for name in ("Roughness", "Metallic", "Coat Weight"):
                surface.inputs[name].default_value = float(spec[name.lower()])
        else:
            surface, colour = nodes.new("ShaderNodeBsdfDiffuse"), "Color"
        surface.inputs[colour].default_value = (*rgb, 1.0)
        opacity = None
        if texture is not None:
            height, width = texture.shape[:2]
            image = bpy.data.images.new("texture", width, height, alpha=True)
            image.colorspace_settings.name = "sRGB"
            image.alpha_mode = "CHANNEL_PACKED"
            # Blender's first row is the bottom one.
            image.pixels.foreach_set((texture[::-1].astype(np.float32) / 255.0).ravel())
            image.update()
            sampler = nodes.new("ShaderNodeTexImage")
            sampler.image = image
            mix = nodes.new("ShaderNodeMixRGB")
            mix.blend_type, mix.inputs[0].default_value = "MULTIPLY", 1.0
            mix.inputs[2].default_value = (*rgb, 1.0)
            links.new(sampler.outputs["Color"], mix.inputs[1])
            links.new(mix.outputs[0], surface.inputs[colour])
            opacity = sampler.outputs["Alpha"]
        if spec["kind"] == "opaque":
            links.new(surface.outputs[0], output.inputs[0])
            return material
        blend = nodes.new("ShaderNodeMixShader")
        links.new(surface.outputs[0], blend.inputs[2])
        links.new(blend.outputs[0], output.inputs[0])
        scale = nodes.new("ShaderNodeMath")
        links.new(scale.outputs[0], blend.inputs[0])
        scale.inputs[0].default_value = 1.0
        if opacity is not None:
            links.new(opacity, scale.inputs[0])
        if spec["kind"] == "cutout":
            scale.operation, scale.inputs[1].default_value = "GREATER_THAN", 0.5
            links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], blend.inputs[1])
        else:
            # Refraction without bending: seen through, yet it covers its pixels in the film's alpha. For all
            # but camera rays it is plainly transparent, or the glass would shade what is behind it.
            scale.operation, scale.inputs[1].default_value = "MULTIPLY", alpha
            glass = nodes.new("ShaderNodeBsdfRefraction")
            glass.inputs["IOR"].default_value = 1.0
            glass.inputs["Roughness"].default_value = 0.0
            first = nodes.new("ShaderNodeMixShader")
            links.new(nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"], first.inputs[0])
            links.new(nodes.new("ShaderNodeBsdfTransparent").outputs[0], first.inputs[1])
            links.new(glass.outputs[0], first.inputs[2])
            links.new(first.outputs[0], blend.inputs[1])
        return material

    def render(self, camera: dict[str, Any]) -> tuple[Any, Any, Any]:
        """(H, W, 3) uint8 colour, (H, W) uint8 alpha, (H, W) float32 depth."""
        by_end = self.channels(camera)
        rgba = np.stack([by_end[f"Combined.{c}"] for c in "RGBA"], axis=-1)
        alpha = np.clip(rgba[..., 3], 0.0, 1.0)
        colour = rgba[..., :3] / np.maximum(alpha, 1e-6)[..., None]
        rgb = np.where(alpha[..., None] > 0, to_srgb(colour) * 255.0 + 0.5, 0).astype(np.uint8)
        depth = by_end["Depth.Z"] if "Depth.Z" in by_end else by_end["Depth.V"]
        depth = np.where((alpha > 0) & (depth < 1e9), depth, np.inf).astype(np.float32)
        return rgb, (alpha * 255.0 + 0.5).astype(np.uint8), depth

    def channels(self, camera: dict[str, Any]) -> dict[str, Any]:
        """Render the scene as it is; (H, W) float32 channels by pass and name."""
        width, height = camera["width"], camera["height"]
        R, t = np.array(camera["R_cv_from_s"]), np.array(camera["t_cv"])
        R_s_from_gl = R.T @ np.diag([1.0, -1.0, -1.0])
        matrix = np.eye(4)
        matrix[:3, :3], matrix[:3, 3] = R_s_from_gl, -R.T @ t
        self.camera.matrix_world = self.matrix(matrix.tolist())
        for lamp, axes in self.suns:
            turn = np.eye(4)
            turn[:3, :3] = R.T @ axes
            lamp.matrix_world = self.matrix(turn.tolist())
        lens = self.camera.data
        lens.lens = camera["focal_px"] / width * lens.sensor_width
        cx, cy = camera["principal_px"]
        lens.shift_x, lens.shift_y = 0.5 - cx / width, (cy - height / 2) / width
        lens.clip_start, lens.clip_end = 0.01, 1000.0
        render = self.scene.render
        render.resolution_x, render.resolution_y = width, height
        path = Path(self.folder.name) / "view.exr"
        render.filepath = str(path)
        self.bpy.ops.render.render(write_still=True)
        channels = read_exr(path.read_bytes())
        return {name.split(".", 1)[-1]: data for name, data in channels.items()}


def beside(name: str) -> Any:
    """A module of the file ``name`` beside this one: the interpreter is told of no folder to look in."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def main() -> None:
    """Answer requests until the input ends."""
    # Blender prints to standard output: give it the error stream and keep the pipe to ourselves.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    requests = sys.stdin.buffer
    bpy = importlib.import_module("bpy")
    write_message(answers, {"ready": bpy.app.version_string})
    studio: Studio | None = None
    photos: Any = None
    while (message := read_message(requests)) is not None:
        header, arrays = message
        try:
            if header["do"] == "setup":
                studio = Studio(bpy, header["samples"], header["denoise"], header["threads"])
                write_message(answers, {})
            elif header["do"] == "mesh" and studio is not None:
                studio.load(header, arrays)
                write_message(answers, {})
            elif header["do"] == "render" and studio is not None:
                rgb, alpha, depth = studio.render(header["camera"])
                write_message(answers, {}, {"rgb": rgb, "alpha": alpha, "depth": depth})
            elif header["do"] == "environment" and studio is not None:
                photos = photos or beside("blender_worker_photo").PhotoSet(studio)
                photos.light(header["path"], arrays.get("pixels"))
                write_message(answers, {})
            elif header["do"] == "photo" and photos is not None:
                write_message(answers, {}, photos.render(header))
            else:
                write_message(answers, {"error": f"request {header['do']!r} out of order"})
        except Exception as error:
            write_message(answers, {"error": f"{type(error).__name__}: {error}"})


if __name__ == "__main__":
    main()
