"""The default renderer: a z-buffer rasteriser for one CPU core a thread, with deferred shading."""

from __future__ import annotations

import math
import threading
from hashlib import sha256
from weakref import WeakKeyDictionary

import numpy as np

from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh
from cadpose.records import Views
from cadpose.rendering.lights import STUDIO, Lights
from cadpose.rendering.scene import Scene, build_scene
from cadpose.rendering.shading import find_visible, prepare, shade
from cadpose.rendering.unsnapped import draw_general
from cadpose.rendering.visibility import LANES, depth_scales, draw, draw_cutout, project


class Rasteriser:
    """Draws meshes with textures, material colours and normals; nothing but numpy and numba is needed.

    Faces are drawn from both sides. Semi-transparent materials cover their pixels in the mask and are
    mixed, the nearest layer only, with the opaque face behind; textures with holes are cut out at half
    opacity. Surfaces nearer than 0.01 (in the mesh's units) are cut off. The same input gives the same
    bytes. One instance may be used from several threads: kernels run without the GIL, each thread with
    its own buffers.

    Args:
        supersample: Visibility samples a pixel along each axis, 1 to 4; each face is shaded once a pixel.
        lights: The light.

    Raises:
        ValueError: ``supersample`` is out of range.
    """

    def __init__(self, supersample: int = 2, lights: Lights = STUDIO) -> None:
        if not 1 <= supersample <= 4:
            raise ValueError(f"supersample must be 1 to 4, got {supersample}")
        self.supersample = supersample
        self.lights = lights
        self.name = f"raster-{supersample}x{supersample}"
        if lights != STUDIO:
            # Part of the key of what is kept: what is lit otherwise looks otherwise.
            self.name += "-" + sha256(lights.packed().tobytes()).hexdigest()[:8]
        self._scenes: WeakKeyDictionary[Mesh, Scene] = WeakKeyDictionary()
        self._local = threading.local()

    def render(self, mesh: Mesh, cameras: Cameras) -> Views:
        """N views of ``mesh``, one a camera.

        Colour is that of the covered part of a pixel (not multiplied by alpha); depth is the z of the face
        that covers most of the pixel, at the pixel's centre.

        Raises:
            ValueError: the mesh has more than 16.7 million faces, or the image is wider or higher than
                16384 samples.
        """
        return self.render_scene(self.scene(mesh), cameras)

    def render_scene(self, scene: Scene, cameras: Cameras, lights: Lights | None = None) -> Views:
        """As :meth:`render`, of a scene that was laid out (and perhaps changed) before, in its own light."""
        ss = self.supersample
        n, height, width = len(cameras), cameras.height, cameras.width
        if max(width, height) * ss > 16384:
            raise ValueError(f"{width} x {height} pixels are too many to draw: 16384 samples a side at most")
        light = (lights or self.lights).packed()
        rgb = np.zeros((n, height, width, 3), np.uint8)
        alpha = np.zeros((n, height, width), np.uint8)
        depth = np.full((n, height, width), np.inf, np.float32)
        for i in range(n):
            self._view(scene, cameras, i, light, rgb[i], alpha[i], depth[i])
        return Views(rgb=rgb, alpha=alpha, depth=depth)

    def scene(self, mesh: Mesh) -> Scene:
        """The mesh laid out for drawing, made once."""
        scene = self._scenes.get(mesh)
        if scene is None:
            scene = self._scenes[mesh] = build_scene(mesh)
        return scene

    def _view(
        self,
        scene: Scene,
        cameras: Cameras,
        i: int,
        light: FloatArray,
        rgb: np.ndarray[tuple[int, ...], np.dtype[np.uint8]],
        alpha: np.ndarray[tuple[int, ...], np.dtype[np.uint8]],
        depth: np.ndarray[tuple[int, ...], np.dtype[np.float32]],
    ) -> None:
        ss, width, height = self.supersample, cameras.width, cameras.height
        R, focal = cameras.R_cv_from_s[i], float(cameras.focal_px[i])
        cx, cy = (float(v) for v in cameras.principal_px[i])
        t = cameras.t_cv[i]
        screen = self._buffer("screen", np.int32, len(scene.vertices), 4)
        columns, rows = width * ss, height * ss
        depths = scene.corners @ R[2] + t[2]
        scale, tie = depth_scales(float(depths.min()), float(depths.max()))
        x0, y0, x1, y1, unsnapped = project(scene.coordinates, R, t, focal, cx, cy, ss, scale, screen)
        if unsnapped:
            x0, y0, x1, y1 = 0, 0, width, height
        else:
            x0, y0 = max(x0 // ss, 0), max(y0 // ss, 0)
            x1, y1 = min(x1 // ss + 1, width), min(y1 // ss + 1, height)
        if x0 >= x1 or y0 >= y1:
            return
        has_glass = len(scene.faces) > scene.opaque + scene.cutout
        words = self._buffer("words", np.int64, rows, columns + LANES)
        glass = self._buffer("glass", np.int64, rows, columns + LANES) if has_glass else words
        cut_end = scene.opaque + scene.cutout
        mapped = (scene.uv, scene.material, scene.material_levels, scene.levels, scene.texels)
        ranges = (
            (0, scene.opaque, False, words),
            (scene.opaque, cut_end, True, words),
            (cut_end, len(scene.faces), False, glass),
        )
        for target in (words, glass) if has_glass else (words,):
            target[y0 * ss : y1 * ss, x0 * ss : x1 * ss] = 0
        for begin, end, cutout, target in ranges:
            if begin == end:
                continue
            common = (scene.faces, begin, end, screen, columns, rows, tie)
            if cutout:
                draw_cutout(*common, scene.uv_area, *mapped, target)
            else:
                draw(*common, target)
            if unsnapped:
                # Not a matrix product: BLAS may round equal vertices differently, which opens cracks.
                cam = sum(scene.coordinates[k][:, None] * R[:, k] for k in range(3)) + t
                draw_general(
                    scene.faces, begin, end, screen, cam, focal, cx, cy, ss, scale, tie,
                    cutout, *mapped, columns, rows, target,
                )  # fmt: skip
        slot_of, visible = self._slots(len(scene.faces))
        count = find_visible(x0 * ss, y0 * ss, x1 * ss, y1 * ss, words, glass, has_glass, slot_of, visible)
        planes = self._buffer("planes", np.float64, count, 24)
        prepare(
            visible, count, scene.faces, scene.vertices, R, t, focal, cx, cy, scene.normals, scene.uv,
            scene.uv_area, scene.look, scene.material, scene.rgba, scene.material_levels, scene.levels,
            light, planes,
        )  # fmt: skip
        shade(
            x0, y0, x1, y1, ss, words, glass, has_glass, planes, scene.levels, scene.texels,
            rgb, alpha, depth,
        )  # fmt: skip

    def _slots(self, faces: int) -> tuple[np.ndarray, np.ndarray]:
        slot_of = getattr(self._local, "slot_of", None)
        if slot_of is None or len(slot_of) < faces:
            self._local.slot_of = slot_of = np.full(faces, -1, np.int32)
        return slot_of, self._buffer("visible", np.int32, faces)

    def _buffer(self, name: str, dtype: type, *shape: int) -> np.ndarray:
        """A scratch array of this thread, kept for the next view; its content is left over."""
        kept = getattr(self._local, name, None)
        size = math.prod(shape)
        if kept is None or kept.size < size:
            kept = np.empty(size, dtype)
            setattr(self._local, name, kept)
        return kept[:size].reshape(shape)
