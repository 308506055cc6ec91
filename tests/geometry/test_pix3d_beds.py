"""The exact cameras of three Pix3D photos put the given CAD onto the given masks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

from cadpose.geometry.angles import angles_from_rotation, azimuth_error, geodesic_degrees
from cadpose.geometry.boxes import Box, mask_iou
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.geometry.labels import Pix3dCamera, from_pix3d
from cadpose.records import Rotation

SUBPIXELS = 4


@pytest.fixture(scope="module")
def beds(bench: Path) -> list[dict[str, Any]]:
    folder = bench / "bench" / "pix3d_beds"
    if not folder.is_dir():
        pytest.skip(f"needs the three Pix3D photos: no folder {folder}")
    labels = json.loads((folder / "pix3d.json").read_text(encoding="utf-8"))
    assert len(labels) == 3
    return [label | {"folder": folder} for label in labels]


def camera_of(label: dict[str, Any]) -> Pix3dCamera:
    return from_pix3d(
        np.array(label["rot_mat"]),
        np.array(label["trans_mat"]),
        label["focal_length"],
        tuple(label["img_size"]),
        np.array(label["cam_position"]),
    )


def read_obj(path: Path) -> tuple[FloatArray, list[list[int]]]:
    """Vertices and faces of a plain OBJ, with no library between the file and this test."""
    vertices, faces = [], []
    for line in path.read_text(encoding="utf-8").splitlines():
        kind, *values = line.split() or [""]
        if kind == "v":
            vertices.append([float(v) for v in values[:3]])
        elif kind == "f":
            faces.append([int(v.split("/")[0]) - 1 for v in values])
    return np.array(vertices), faces


def silhouette(pixels: FloatArray, faces: list[list[int]], width: int, height: int) -> NDArray[np.bool_]:
    """(height, width) pixels that are covered at least by half."""
    shift = 8
    canvas = np.zeros((height * SUBPIXELS, width * SUBPIXELS), np.uint8)
    # OpenCV's integer coordinates are pixel centres, ours are corners: half a sub-pixel between them.
    fixed = np.round((pixels * SUBPIXELS - 0.5) * (1 << shift)).astype(np.int32)
    for face in faces:
        for i in range(1, len(face) - 1):
            cv2.fillConvexPoly(canvas, fixed[[face[0], face[i], face[i + 1]]], 1, cv2.LINE_8, shift)
    coverage = canvas.reshape(height, SUBPIXELS, width, SUBPIXELS).mean(axis=(1, 3))
    return np.asarray(coverage >= 0.5)


def test_reprojected_silhouette_is_the_given_mask(beds: list[dict[str, Any]]) -> None:
    for label in beds:
        camera, (width, height) = camera_of(label), label["img_size"]
        vertices, faces = read_obj(label["folder"] / label["model"])
        cameras = Cameras(
            R_cv_from_s=camera.R_cv_from_s[None],
            t_cv=camera.t_cv[None],
            focal_px=np.array([camera.focal_px]),
            principal_px=np.array([camera.principal_px]),
            width=width,
            height=height,
        )
        pixels = cameras.project(vertices)[0]
        drawn = silhouette(pixels, faces, width, height)
        given = np.asarray(Image.open(label["folder"] / label["mask"]).convert("L")) >= 128
        assert given.shape == drawn.shape
        assert mask_iou(drawn, given) >= 0.99, label["img"]
        # A pixel off in any direction is worse, so the pixel convention is right to within half of one.
        for axis, step in ((0, 1), (0, -1), (1, 1), (1, -1)):
            assert mask_iou(np.roll(drawn, step, axis), given) < mask_iou(drawn, given), label["img"]
        box = Box.from_mask(given)
        np.testing.assert_allclose(box.to_tuple(), label["bbox"], atol=1.0)


def test_angles_agree_with_the_rotation_once_the_camera_looks_at_the_bed(beds: list[dict[str, Any]]) -> None:
    """cam_position belongs to a camera turned towards the bed, rot_mat to the photo's own."""
    for label in beds:
        camera = camera_of(label)
        sight = camera.t_cv / np.linalg.norm(camera.t_cv)
        # Smallest turn that takes the line of sight onto the optical axis (Rodrigues' formula).
        v, c = np.cross(sight, [0.0, 0.0, 1.0]), sight[2]
        K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
        turn = np.eye(3) + K + K @ K / (1.0 + c)
        azimuth, elevation, _ = angles_from_rotation(turn @ camera.R_cv_from_s)
        assert azimuth_error(azimuth, camera.azimuth) < 1e-3, label["img"]
        assert elevation == pytest.approx(camera.elevation, abs=1e-3), label["img"]
        # Without that turn they differ by no more than the angle off the axis.
        plain = Rotation.from_matrix(camera.R_cv_from_s)
        off_axis = float(np.rad2deg(np.arccos(c)))
        assert geodesic_degrees(turn, np.eye(3)) == pytest.approx(off_axis, abs=1e-6)
        assert azimuth_error(plain.azimuth, camera.azimuth) < off_axis
        assert abs(plain.elevation - camera.elevation) < off_axis + 1e-3


def test_both_beds_have_their_headboard_at_the_back(beds: list[dict[str, Any]]) -> None:
    """ShapeNet axes: front -z, so the tall end of a bed lies at +z."""
    for label in beds:
        vertices, _ = read_obj(label["folder"] / label["model"])
        back = vertices[vertices[:, 2] > 0.3 * np.ptp(vertices[:, 2])]
        front = vertices[vertices[:, 2] < -0.3 * np.ptp(vertices[:, 2])]
        assert back[:, 1].max() > front[:, 1].max() + 0.1
