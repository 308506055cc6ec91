"""Other people's renderers behind the Renderer protocol, as far as a timing needs it.

All are optional and imported only when asked for. They draw the same triangles, colours and textures from
the same cameras; the edges of their masks and their shading are their own.
"""

from __future__ import annotations

import importlib
import os
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import R_gl_from_cv
from cadpose.library.mesh import Mesh
from cadpose.records import Views


def _views(rgba: list[NDArray[np.uint8]], depth: list[NDArray[np.float32]]) -> Views:
    stack = np.stack(rgba)
    return Views(rgb=np.ascontiguousarray(stack[..., :3]), alpha=stack[..., 3].copy(), depth=np.stack(depth))


class Panda3d:
    """Panda3D's software renderer, tinydisplay.

    Raises:
        ImportError: Panda3D is not installed, or a system library it needs.
        RuntimeError: it cannot open an off-screen buffer.
    """

    name = "panda3d tinydisplay"

    def __init__(self) -> None:
        self._core: Any = importlib.import_module("panda3d.core")
        core = self._core
        core.load_prc_file_data(
            "",
            "load-display p3tinydisplay\naudio-library-name null\nnotify-level error",
        )
        self._engine = core.GraphicsEngine.get_global_ptr()
        self._pipe = core.GraphicsPipeSelection.get_global_ptr().make_default_pipe()
        if self._pipe is None:
            raise RuntimeError("Panda3D has no software display here")
        self._buffer: Any = None
        self._mesh: Mesh | None = None
        self._root: Any = None

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """Colour and a mask from the clear colour; depth is not read back."""
        core = self._core
        if self._buffer is None or self._buffer.get_x_size() != cameras.width:
            self._open(cameras.width, cameras.height)
        if self._mesh is not mesh:
            self._load(mesh)
        rgba = []
        for i in range(len(cameras)):
            f, (cx, cy) = cameras.focal_px[i], cameras.principal_px[i]
            lens = core.PerspectiveLens()
            lens.set_film_size(cameras.width, cameras.height)
            lens.set_focal_length(float(f))
            lens.set_film_offset(float(cameras.width / 2 - cx), float(cy - cameras.height / 2))
            lens.set_near_far(0.1, 100.0)
            lens.set_coordinate_system(core.CS_yup_right)
            self._camera.node().set_lens(lens)
            R = R_gl_from_cv @ cameras.R_cv_from_s[i]
            matrix = np.eye(4)
            matrix[:3, :3], matrix[3, :3] = R, -(R.T @ (R_gl_from_cv @ cameras.t_cv[i]))
            self._camera.set_mat(core.LMatrix4f(*matrix.ravel().tolist()))
            self._engine.render_frame()
            image = np.frombuffer(self._texture.get_ram_image_as("RGBA"), np.uint8)
            rgba.append(image.reshape(cameras.height, cameras.width, 4)[::-1].copy())
        empty = np.full((cameras.height, cameras.width), np.inf, np.float32)
        return _views(rgba, [empty] * len(rgba))

    def _open(self, width: int, height: int) -> None:
        core = self._core
        properties = core.FrameBufferProperties()
        properties.set_rgba_bits(8, 8, 8, 8)
        properties.set_depth_bits(24)
        self._buffer = self._engine.make_output(
            self._pipe, "view", 0, properties, core.WindowProperties.size(width, height),
            core.GraphicsPipe.BF_refuse_window,
        )  # fmt: skip
        if self._buffer is None:
            raise RuntimeError("Panda3D cannot open an off-screen buffer")
        self._texture = core.Texture()
        self._buffer.add_render_texture(self._texture, core.GraphicsOutput.RTM_copy_ram)
        self._buffer.set_clear_color(core.LColor(0, 0, 0, 0))
        self._camera = core.NodePath(core.Camera("camera"))
        self._buffer.make_display_region().set_camera(self._camera)
        self._mesh = None

    def _load(self, mesh: Mesh) -> None:
        core = self._core
        root = core.NodePath("scene")
        self._camera.reparent_to(root)
        root.set_two_sided(True)
        layout = core.GeomVertexFormat.get_v3n3t2()
        for m, material in enumerate(mesh.materials):
            chosen = np.flatnonzero(mesh.face_material == m)
            if len(chosen) == 0:
                continue
            corners = np.concatenate(
                [
                    mesh.vertices[mesh.faces[chosen]],
                    mesh.corner_normals[chosen],
                    mesh.corner_uv[chosen],
                ],
                axis=-1,
            ).reshape(-1, 8)
            data = core.GeomVertexData("mesh", layout, core.Geom.UH_static)
            data.unclean_set_num_rows(len(corners))
            packed = np.ascontiguousarray(corners, np.float32).tobytes()
            memoryview(data.modify_array(0)).cast("B")[:] = packed
            triangles = core.GeomTriangles(core.Geom.UH_static)
            triangles.add_consecutive_vertices(0, len(corners))
            geom = core.Geom(data)
            geom.add_primitive(triangles)
            node = core.GeomNode("mesh")
            node.add_geom(geom)
            path = root.attach_new_node(node)
            path.set_color(*material.rgba)
            if material.texture is not None:
                texture = core.Texture()
                # tinydisplay takes powers of two only.
                height, width = (1 << (n.bit_length() - 1) for n in material.texture.shape[:2])
                image = cv2.resize(material.texture, (width, height), interpolation=cv2.INTER_AREA)
                texture.setup_2d_texture(width, height, core.Texture.T_unsigned_byte, core.Texture.F_rgb)
                bgr = np.ascontiguousarray(image[::-1, :, 2::-1])
                texture.set_ram_image(bgr.tobytes())
                texture.set_minfilter(core.SamplerState.FT_nearest_mipmap_nearest)
                path.set_texture(texture)
        for kind, strength in (("AmbientLight", 0.4), ("DirectionalLight", 0.7)):
            light = getattr(core, kind)("light")
            light.set_color((strength, strength, strength, 1))
            root.set_light(self._camera.attach_new_node(light))
        self._root, self._mesh = root, mesh


class Pyrender:
    """pyrender, off screen through EGL or, with PYOPENGL_PLATFORM=osmesa, Mesa's software rasteriser.

    Raises:
        ImportError: it, or a system library it needs, is not installed.
    """

    name = "pyrender"

    def __init__(self) -> None:
        os.environ.setdefault("PYOPENGL_PLATFORM", "egl")
        # pyrender is not maintained and still uses a name that numpy 2 has dropped.
        if not hasattr(np, "infty"):
            setattr(np, "infty", np.inf)  # noqa: B010
        self._pyrender: Any = importlib.import_module("pyrender")
        self._renderer: Any = None
        self._mesh: Mesh | None = None
        self._scene: Any = None

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """Colour, mask and depth."""
        pr = self._pyrender
        if self._renderer is None:
            self._renderer = pr.OffscreenRenderer(cameras.width, cameras.height)
        if self._mesh is not mesh:
            self._scene = pr.Scene(bg_color=[0, 0, 0, 0], ambient_light=[0.4, 0.4, 0.4])
            self._scene.add(pr.Mesh(self._primitives(mesh)))
            self._mesh = mesh
        rgba, depths = [], []
        for i in range(len(cameras)):
            f, (cx, cy) = float(cameras.focal_px[i]), cameras.principal_px[i]
            camera = pr.IntrinsicsCamera(f, f, float(cx), float(cy), znear=0.1, zfar=100.0)
            matrix = np.eye(4)
            R = cameras.R_cv_from_s[i]
            matrix[:3, :3], matrix[:3, 3] = R.T @ R_gl_from_cv, -R.T @ cameras.t_cv[i]
            nodes = [
                self._scene.add(camera, pose=matrix),
                self._scene.add(pr.DirectionalLight(intensity=3.0), pose=matrix),
            ]
            colour, depth = self._renderer.render(
                self._scene, flags=pr.RenderFlags.RGBA | pr.RenderFlags.SKIP_CULL_FACES
            )
            for node in nodes:
                self._scene.remove_node(node)
            rgba.append(np.dstack([colour[..., :3], np.where(depth > 0, 255, 0).astype(np.uint8)]))
            depths.append(np.where(depth > 0, depth, np.inf).astype(np.float32))
        return _views(rgba, depths)

    def _primitives(self, mesh: Mesh) -> list[Any]:
        pr = self._pyrender
        out = []
        for m, material in enumerate(mesh.materials):
            chosen = np.flatnonzero(mesh.face_material == m)
            if len(chosen) == 0:
                continue
            texture = None
            if material.texture is not None:
                # Rows of three bytes a texel would have to be padded to four.
                image = material.texture
                rgba = image if image.shape[2] == 4 else cv2.cvtColor(image, cv2.COLOR_RGB2RGBA)
                texture = pr.Texture(source=np.ascontiguousarray(rgba), source_channels="RGBA")
            out.append(
                pr.Primitive(
                    positions=mesh.vertices[mesh.faces[chosen]].reshape(-1, 3),
                    normals=mesh.corner_normals[chosen].reshape(-1, 3),
                    texcoord_0=mesh.corner_uv[chosen].reshape(-1, 2),
                    mode=4,
                    material=pr.MetallicRoughnessMaterial(
                        baseColorFactor=material.rgba,
                        baseColorTexture=texture,
                        metallicFactor=0.0,
                        doubleSided=True,
                    ),
                )
            )
        return out
