"""Made-up cars and chairs as OBJ and GLB files, and photos of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray
from PIL import Image

from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.records import CadModel, Mask, Photo, Rotation
from cadpose.rendering.raster import Rasteriser

# (low corner, high corner, colour); x to the right, y up, the front at -z.
Part = tuple[tuple[float, float, float], tuple[float, float, float], tuple[float, float, float]]

_GLASS, _TYRE, _LAMP, _TAIL = (0.2, 0.25, 0.3), (0.08, 0.08, 0.08), (1.0, 0.95, 0.6), (0.8, 0.05, 0.05)


def _car(
    paint: tuple[float, float, float], *, cabin: tuple[float, float], roof: float, length: float
) -> list[Part]:
    half = length / 2
    wheels: list[Part] = [
        ((x, 0.0, z - 0.33), (x + 0.25, 0.66, z + 0.33), _TYRE)
        for x in (-0.92, 0.67)
        for z in (-half * 0.6, half * 0.62)
    ]
    return [
        ((-0.9, 0.3, -half), (0.9, 0.95, half), paint),
        ((-0.8, 0.95, cabin[0]), (0.8, roof, cabin[1]), _GLASS),
        ((-0.75, roof, cabin[0] + 0.1), (0.75, roof + 0.08, cabin[1]), paint),
        *wheels,
        ((-0.85, 0.6, -half - 0.04), (-0.5, 0.85, -half), _LAMP),
        ((0.5, 0.6, -half - 0.04), (0.85, 0.85, -half), _LAMP),
        ((-0.85, 0.6, half), (0.85, 0.8, half + 0.04), _TAIL),
    ]


def _chair(wood: tuple[float, float, float], *, back: float, arms: bool) -> list[Part]:
    legs: list[Part] = [
        ((x, 0.0, z), (x + 0.06, 0.45, z + 0.06), wood) for x in (-0.25, 0.19) for z in (-0.25, 0.19)
    ]
    sides: list[Part] = [((x, 0.5, -0.2), (x + 0.06, 0.7, 0.25), wood) for x in (-0.31, 0.25)]
    return [
        *legs,
        ((-0.26, 0.45, -0.27), (0.26, 0.52, 0.25), (0.6, 0.15, 0.15)),
        ((-0.26, 0.52, 0.2), (0.26, back, 0.26), wood),
        *(sides if arms else ()),
    ]


#: File in the source folder to its parts.
MODELS: dict[str, list[Part]] = {
    "car/hatch.obj": _car((0.75, 0.1, 0.1), cabin=(-0.6, 1.8), roof=1.45, length=3.8),
    "car/pickup.obj": _car((0.85, 0.85, 0.82), cabin=(-1.1, 0.3), roof=1.7, length=5.2),
    "car/van.glb": _car((0.1, 0.3, 0.7), cabin=(-1.6, 2.3), roof=2.3, length=4.7),
    "chair/plain.obj": _chair((0.55, 0.4, 0.2), back=0.95, arms=False),
    "chair/throne.glb": _chair((0.25, 0.2, 0.15), back=1.5, arms=True),
}


def write_models(folder: Path) -> Path:
    """The models as files in ``folder``, one sub-folder a category."""
    for name, parts in MODELS.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".obj":
            _write_obj(path, parts)
        else:
            _write_glb(path, parts)
    return folder


def _write_obj(path: Path, parts: Sequence[Part]) -> None:
    colours = list(dict.fromkeys(colour for *_, colour in parts))
    obj, count = [f"mtllib {path.stem}.mtl"], 0
    for low, high, colour in parts:
        box = trimesh.creation.box(bounds=[low, high])
        obj += [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in box.vertices]
        obj += [f"usemtl m{colours.index(colour)}"]
        obj += [f"f {a} {b} {c}" for a, b, c in box.faces + 1 + count]
        count += len(box.vertices)
    path.write_text("\n".join(obj) + "\n")
    mtl = [f"newmtl m{i}\nKd {r} {g} {b}\n" for i, (r, g, b) in enumerate(colours)]
    path.with_suffix(".mtl").write_text("\n".join(mtl))


def _write_glb(path: Path, parts: Sequence[Part]) -> None:
    visual: Any = trimesh.visual  # untyped
    scene: Any = trimesh.Scene()
    for low, high, colour in parts:
        box = trimesh.creation.box(bounds=[low, high])
        material = visual.material.PBRMaterial(baseColorFactor=[*colour, 1.0])
        box.visual = visual.TextureVisuals(material=material)
        scene.add_geometry(box)
    path.write_bytes(scene.export(file_type="glb"))


@dataclass(frozen=True, eq=False)
class Shot:
    """A photo of one model, and everything that is true of it."""

    photo: Photo
    box: Box
    mask: Mask
    cad: CadModel
    rotation: Rotation
    focal_px: float


def shoot(
    library: Library,
    cad_id: str,
    rotation: Rotation,
    *,
    size: tuple[int, int] = (400, 300),
    middle: tuple[float, float] = (210.0, 140.0),
    focal_px: float = 420.0,
    name: str = "street.png",
) -> Shot:
    """Photograph a model on a lawn under the sky; ``middle`` is where its origin appears."""
    cad, (width, height) = library.get(cad_id), size
    cameras = Cameras.from_rotations(
        rotation.to_matrix(), focal_px=focal_px, principal_px=middle, width=width, height=height
    )
    views = Rasteriser().render(library.mesh(cad), cameras)
    noise = np.random.default_rng(5).normal(0.0, 4.0, (height, width, 1))
    sky, lawn = np.array([176.0, 205.0, 232.0]), np.array([112.0, 150.0, 88.0])
    ground = np.where((np.arange(height) > 0.45 * height)[:, None, None], lawn, sky) + noise
    alpha = views.alpha[0, ..., None] / 255.0
    rgb = np.clip(views.rgb[0] * alpha + ground * (1.0 - alpha), 0, 255).astype(np.uint8)
    mask = views.mask[0]
    return Shot(Photo(rgb, name), Box.from_mask(mask), mask, cad, rotation, focal_px)


def save(path: Path, rgb: NDArray[np.uint8]) -> Path:
    """Write a picture; the suffix tells the format."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(rgb).save(path)
    return path
