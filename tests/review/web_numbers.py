"""Python's numbers that the page's unit tests check its own against.

    python -m tests.review.web_numbers

writes them anew into web/src/view/fixtures.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cadpose.geometry.angles import angles_from_rotation, rotation_from_angles
from cadpose.library.mesh import Material, Mesh
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rendering.scene import build_scene

FOLDER = Path(__file__).resolve().parents[2] / "web" / "src" / "view" / "fixtures"


def angles() -> dict[str, Any]:
    """Rotations both ways, and projected points."""
    rng = np.random.default_rng(4)
    told = [
        (0, 0, 0),
        (90, 0, 0),
        (180, 30, -90),
        (270, -45, 180),
        (33, 90, 20),
        (200, -90, -15),
        (359, 89.9, 1),
    ]
    told += [tuple(np.round(rng.uniform((0, -90, -180), (360, 90, 180)), 3).tolist()) for _ in range(12)]
    rotations = []
    for azimuth, elevation, inplane in told:
        R = rotation_from_angles(azimuth, elevation, inplane)
        decoded = [float(angle) for angle in angles_from_rotation(R)]
        rotations.append(
            {"angles": [azimuth, elevation, inplane], "R": R.ravel().tolist(), "decoded": decoded}
        )
    projections = []
    for azimuth, elevation, inplane in told[4:12]:
        width, height = (int(n) for n in rng.integers(101, 1500, 2))
        focal, x, y = np.round(rng.uniform((50, -100, -50), (3000, 1500, 1500)), 3).tolist()
        pose = Pose4Dof(Rotation(azimuth, elevation, inplane), focal, (x, y))
        points = np.round(rng.uniform(-0.5, 0.5, (5, 3)), 4)
        projections.append(
            {
                "pose": {
                    "azimuth": pose.rotation.azimuth,
                    "elevation": pose.rotation.elevation,
                    "inplane": pose.rotation.inplane,
                    "focal_px": pose.focal_px,
                    "principal_px": list(pose.principal_px),
                    "t_z": pose.t_z,
                },
                "width": width,
                "height": height,
                "points": points.tolist(),
                "pixels": pose.project(points).tolist(),
            }
        )
    return {"rotations": rotations, "projections": projections}


def masks() -> list[dict[str, Any]]:
    """Masks with pycocotools' text of them."""
    from pycocotools import mask as coco

    rng = np.random.default_rng(11)
    ellipse = (np.mgrid[:23, :41][0] - 11) ** 2 / 80 + (np.mgrid[:23, :41][1] - 20) ** 2 / 300 < 1
    made: dict[str, NDArray[np.bool_]] = {
        "nothing": np.zeros((3, 5), np.bool_),
        "everything": np.ones((4, 3), np.bool_),
        "one pixel": np.eye(1, dtype=np.bool_),
        "first pixel": np.arange(12).reshape(3, 4) == 0,
        "last pixel": np.arange(12).reshape(3, 4) == 11,
        "ellipse": ellipse,
        "noise": rng.random((17, 29)) < 0.5,
        "sparse noise": rng.random((61, 37)) < 0.02,
        "long runs": np.arange(90 * 70).reshape(90, 70) // 2500 == 1,
    }
    told = []
    for name, mask in made.items():
        text = coco.encode(np.asfortranarray(mask.astype(np.uint8)))["counts"].decode("ascii")
        rows = ["".join(map(str, row)) for row in mask.astype(int).tolist()]
        told.append({"name": name, "rows": rows, "rle": {"size": list(mask.shape), "counts": text}})
    return told


def square(texture: NDArray[np.uint8] | None, alpha: float) -> Mesh:
    """Two faces in the x-y plane."""
    half = 0.5 / np.sqrt(2.0)
    vertices = np.array([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], np.float32)
    faces = np.array([(0, 1, 2), (0, 2, 3)], np.int32)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], np.float32)
    normals = np.broadcast_to(np.array((0, 0, 1), np.float32), (2, 3, 3)).copy()
    material = Material((0.8, 0.5, 0.2, alpha), texture, "square")
    return Mesh(vertices, faces, normals, corners[faces], np.zeros(2, np.int32), (material,))


def holes() -> list[dict[str, Any]]:
    """Opacities of textures, and their reductions by the rasteriser."""
    rng = np.random.default_rng(6)
    told = []
    for width, height in ((16, 8), (13, 9), (1, 5), (7, 2)):
        data = rng.integers(0, 256, (height, width), np.uint8)
        scene = build_scene(square(np.dstack([data] * 4), 1.0))
        opacity = (scene.texels >> 24).tolist()
        reduced = [
            {"width": w, "height": h, "data": opacity[first : first + w * h]}
            for first, w, h in scene.levels[1:].tolist()
        ]
        told.append({"width": width, "height": height, "data": data.ravel().tolist(), "reduced": reduced})
    return told


FILES = {"angles.json": angles, "holes.json": holes, "rle.json": masks}


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name, make in FILES.items():
        (FOLDER / name).write_text(json.dumps(make(), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
