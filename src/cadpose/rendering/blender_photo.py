"""Photo-like views from Blender: lit by an environment, glossy or matt, with a shadow on the ground."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from cadpose.errors import DependencyError, InputError
from cadpose.geometry.camera import Cameras
from cadpose.rendering.blender import BlenderRenderer
from cadpose.rendering.blender_worker import to_srgb
from cadpose.rendering.scene import TEXTURED, Scene

#: Files that an environment may come from, and their largest size.
SUFFIXES = frozenset({".hdr", ".exr"})
MAX_BYTES = 512 * 2**20
#: Light above this share of white is compressed, as cameras do.
_SHOULDER = 0.7

FloatPicture = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Surface:
    """How a material shines (Blender's Principled BSDF).

    Attributes:
        roughness: 0 a mirror, 1 matt.
        metallic: 0 a dielectric, 1 a metal.
        coat: Weight of a clear coat.

    Raises:
        ValueError: a value is outside [0, 1].
    """

    roughness: float = 0.6
    metallic: float = 0.0
    coat: float = 0.0

    def __post_init__(self) -> None:
        if not all(0.0 <= v <= 1.0 for v in (self.roughness, self.metallic, self.coat)):
            raise ValueError("roughness, metallic and coat must be in [0, 1]")


@dataclass(frozen=True, eq=False)
class BlenderView:
    """One view.

    Attributes:
        rgb: (H, W, 3) uint8 sRGB, not multiplied by alpha.
        alpha: (H, W) uint8 coverage of the object, without its shadow.
        light: (H, W, 3) float32, what a backdrop in linear light is to be multiplied by: the shadow.
    """

    rgb: NDArray[np.uint8]
    alpha: NDArray[np.uint8]
    light: FloatPicture


class BlenderPhotographer(BlenderRenderer):
    """Draws laid-out scenes with Cycles in a worker process.

    Args:
        samples: Camera rays a pixel.
        threads: Threads in the worker; 0 uses every core.
        folder: Virtualenv that setup_blender made; the default is blender_folder().
        timeout: Seconds that one view may take.

    Raises:
        DependencyError: Blender is not set up.
        ValueError: an argument is out of range.
    """

    def __init__(
        self, samples: int = 16, *, threads: int = 0, folder: Path | None = None, timeout: float = 300.0
    ) -> None:
        super().__init__(samples, threads=threads, folder=folder, timeout=timeout)
        self._scene: Scene | None = None
        self._environment: object = None

    def light(self, environment: Path | FloatPicture) -> None:
        """Light what follows by an environment: a file, or (H, W, 3) linear light, latitude by longitude.

        Its brightness does not count: the upper half is brought to a mean of 1.

        Raises:
            InputError: the file cannot be used.
            DependencyError: the worker failed.
        """
        with self._lock:
            if self._process is None:
                self._start()
            if self._environment is environment:
                return
            self._environment = None
            if isinstance(environment, Path):
                check_environment(environment)
                try:
                    self._ask({"do": "environment", "path": str(environment.resolve())})
                except DependencyError as error:
                    if self._process is None:
                        raise
                    raise InputError(f"{environment}: Blender cannot use it ({error})") from error
            else:
                self._ask({"do": "environment", "path": None}, {"pixels": environment})
            self._environment = environment

    def view(
        self,
        scene: Scene,
        surfaces: Sequence[Surface],
        camera: Cameras,
        *,
        turn: float = 0.0,
        exposure: float = 1.0,
        ground: float | None = None,
    ) -> BlenderView:
        """One view of a scene in the light of :meth:`light`.

        Args:
            scene: What to draw.
            surfaces: One a material of the scene.
            camera: One camera.
            turn: By how much the environment is turned about the object's vertical axis, in degrees.
            exposure: How bright white paint is under an even sky.
            ground: Height of the ground that the shadow falls on, None for none.

        Raises:
            DependencyError: the worker failed or took too long.
            ValueError: there is more than one camera, or not a surface for each material.
        """
        if len(camera) != 1 or len(surfaces) != len(scene.rgba):
            raise ValueError("expected one camera and one surface a material")
        if self._environment is None:
            raise ValueError("a view needs light first")
        with self._lock:
            if self._scene is not scene:
                self._scene = None
                self._load_scene(scene, surfaces)
                self._scene = scene
            arrays = self._ask(
                {
                    "do": "photo",
                    "turn": float(np.deg2rad(turn)),
                    "exposure": exposure,
                    "ground": ground,
                    "camera": {
                        "R_cv_from_s": camera.R_cv_from_s[0].tolist(),
                        "t_cv": camera.t_cv[0].tolist(),
                        "focal_px": float(camera.focal_px[0]),
                        "principal_px": camera.principal_px[0].tolist(),
                        "width": camera.width,
                        "height": camera.height,
                    },
                }
            )
        alpha = np.clip(arrays["alpha"], 0.0, 1.0)
        linear = arrays["rgb"] / np.maximum(alpha, 1e-6)[..., None]
        rgb = np.where(alpha[..., None] > 0, to_srgb(_compressed(linear)) * 255.0 + 0.5, 0.0)
        return BlenderView(
            rgb.astype(np.uint8),
            (alpha * 255.0 + 0.5).astype(np.uint8),
            _light(arrays.get("light"), camera),
        )

    def close(self) -> None:
        """End the worker; the next view starts another, and needs light again."""
        self._scene = self._environment = None
        super().close()

    def _load_scene(self, scene: Scene, surfaces: Sequence[Surface]) -> None:
        kinds = np.full(len(scene.rgba), "opaque", "<U8")
        kinds[scene.material[scene.opaque : scene.opaque + scene.cutout]] = "cutout"
        kinds[scene.material[scene.opaque + scene.cutout :]] = "glass"
        textured = np.zeros(len(scene.rgba), np.bool_)
        textured[scene.material[(scene.look & TEXTURED) > 0]] = True
        arrays: dict[str, Any] = {
            "vertices": scene.vertices,
            "faces": scene.faces,
            "corner_normals": scene.normals,
            "corner_uv": scene.uv,
            "face_material": scene.material,
        }
        materials: list[dict[str, Any]] = []
        for i, (rgba, surface) in enumerate(zip(scene.rgba, surfaces, strict=True)):
            materials.append(
                {
                    "rgba": [*(np.clip(rgba[:3], 0, 255) / 255.0).tolist(), float(rgba[3])],
                    "kind": str(kinds[i]),
                    "roughness": surface.roughness,
                    "metallic": surface.metallic,
                    "coat weight": surface.coat,
                }
            )
            if textured[i]:
                first, width, height = scene.levels[scene.material_levels[i, 0]]
                texels = scene.texels[first : first + width * height]
                arrays[f"texture{i}"] = texels.view(np.uint8).reshape(height, width, 4)
        self._loaded = None
        self._ask({"do": "mesh", "materials": materials}, arrays)


def check_environment(path: Path) -> None:
    """See whether a file may be one of an environment, before another program opens it.

    Raises:
        InputError: it is not there, of another kind, or too large.
    """
    if path.suffix.lower() not in SUFFIXES or not path.is_file():
        raise InputError(f"{path} is no .hdr or .exr file to light with")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path} is larger than {MAX_BYTES >> 20} MiB: make the environment smaller")


def _compressed(linear: Any) -> Any:
    """Light beyond the shoulder brought below white, smoothly."""
    over = np.maximum(linear - _SHOULDER, 0.0) / (1.0 - _SHOULDER)
    return np.where(linear > _SHOULDER, _SHOULDER + (1.0 - _SHOULDER) * (1.0 - np.exp(-over)), linear)


def _light(half: Any, camera: Cameras) -> FloatPicture:
    """The light on the ground at full size; even without a ground."""
    if half is None:
        return np.ones((camera.height, camera.width, 3), np.float32)
    # Where the ground ends, or gets no light at all, Blender divides by zero.
    sane = np.clip(np.nan_to_num(half, nan=1.0), 0.0, 1.0).astype(np.float32)
    # Of few rays, colour in a shadow is mostly noise.
    sane = (sane + sane.mean(axis=2, keepdims=True)) / np.float32(2.0)
    large = cv2.resize(sane, (2 * half.shape[1], 2 * half.shape[0]), interpolation=cv2.INTER_LINEAR)
    return np.asarray(large[: camera.height, : camera.width], np.float32)
