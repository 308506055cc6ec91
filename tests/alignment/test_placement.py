from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from cadpose.alignment.placement import Placement, rectangle
from cadpose.alignment.refinement.refine import Refiner
from cadpose.encoder import lite0
from cadpose.library.catalogue import Library
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from tests.small_library import Shot, shoot


@pytest.fixture(scope="module")
def shot(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/van.glb", Rotation(300.0, 10.0))


@pytest.mark.parametrize("align_to", ["box", "paper", "mask"])
def test_the_pose_that_the_photo_was_drawn_with_is_found(
    small_library: Library, shot: Shot, align_to: str
) -> None:
    placed = Placement(Rasteriser(), align_to).place(
        shot.photo, shot.box, shot.mask, small_library.mesh(shot.cad), shot.rotation
    )
    # The paper's principal point, the box's middle, is a little off the origin's.
    close = 0.08 if align_to == "paper" else 0.02
    assert placed.pose.focal_px == pytest.approx(shot.focal_px, rel=close)
    assert placed.mask_iou is not None
    assert placed.mask_iou > (0.8 if align_to == "paper" else 0.95)
    assert (placed.refinement, placed.pose_6dof) == (None, None)


def test_without_a_mask_there_is_no_overlap_to_tell(small_library: Library, shot: Shot) -> None:
    placed = Placement(Rasteriser(), "mask").place(
        shot.photo, shot.box, None, small_library.mesh(shot.cad), shot.rotation
    )
    assert placed.mask_iou is None
    assert placed.box_iou > 0.95


def test_refined_it_fits_better_and_tells_from_where(small_library: Library, shot: Shot) -> None:
    mesh = small_library.mesh(shot.cad)
    near = Rotation(308.0, 6.0)
    plain = Placement(Rasteriser()).place(shot.photo, shot.box, shot.mask, mesh, near)
    placed = Placement(Rasteriser(), refiner=Refiner(lite0()), refine="full").place(
        shot.photo, shot.box, shot.mask, mesh, near
    )
    assert placed.refinement is not None
    assert placed.refinement.start == plain.pose
    assert placed.mask_iou is not None
    assert plain.mask_iou is not None
    assert placed.mask_iou > plain.mask_iou + 0.02
    assert placed.pose.rotation.error_to(shot.rotation) < plain.pose.rotation.error_to(shot.rotation)


def test_a_known_camera_gives_distance_in_diagonals_and_metres(small_library: Library, shot: Shot) -> None:
    camera = PhotoCamera(shot.focal_px, (200.0, 150.0))
    placed = Placement(Rasteriser()).place(
        shot.photo, shot.box, shot.mask, small_library.mesh(shot.cad), shot.rotation,
        camera=camera, diagonal_m=5.0,
    )  # fmt: skip
    assert placed.pose_6dof is not None
    assert np.linalg.norm(placed.pose_6dof.t_cv) == pytest.approx(2.0, rel=0.02)
    assert placed.pose_6dof.to_T_cam_obj(metric=True)[2, 3] == pytest.approx(10.0, rel=0.02)
    assert placed.pose_6dof.camera == camera


def test_a_camera_that_would_stand_in_the_model_gives_no_distance(
    small_library: Library, shot: Shot, caplog: pytest.LogCaptureFixture
) -> None:
    # Millimetres taken for pixels.
    placed = Placement(Rasteriser(), refiner=Refiner(lite0()), refine="fast").place(
        shot.photo, shot.box, shot.mask, small_library.mesh(shot.cad), shot.rotation,
        camera=PhotoCamera(35.0, (200.0, 150.0)), diagonal_m=5.0,
    )  # fmt: skip
    assert placed.pose_6dof is None
    assert "inside the object" in caplog.text


def test_a_refined_pose_in_the_known_camera_is_refined_there(small_library: Library, shot: Shot) -> None:
    camera = PhotoCamera(3.0 * shot.focal_px, (200.0, 150.0))
    placed = Placement(Rasteriser(), refiner=Refiner(lite0()), refine="fast").place(
        shot.photo, shot.box, shot.mask, small_library.mesh(shot.cad), shot.rotation, camera=camera
    )
    assert placed.pose_6dof is not None
    assert placed.pose_6dof.t_cv[2] > 4.0
    plain = Pose6Dof.from_4dof(placed.pose, camera)
    measure = Placement(Rasteriser()).silhouette_iou
    mesh = small_library.mesh(shot.cad)
    own = measure(mesh, placed.pose_6dof, shot.box, shot.mask)
    assert own >= measure(mesh, plain, shot.box, shot.mask) - 1e-3


def test_an_overlap_does_not_depend_on_the_photos_size(small_library: Library, shot: Shot) -> None:
    mesh = small_library.mesh(shot.cad)
    pose = Pose4Dof(shot.rotation, shot.focal_px, (210.0, 140.0))
    whole = Placement(Rasteriser()).silhouette_iou(mesh, pose, shot.box, shot.mask)
    drawn = Rasteriser().render(mesh, pose.to_cameras(400, 300)).mask[0]
    plain = (drawn & shot.mask).sum() / (drawn | shot.mask).sum()
    assert whole == pytest.approx(plain, abs=0.02)
    assert rectangle(pose, mesh).width == pytest.approx(shot.box.width, abs=2.0)


def test_a_known_rotation_is_kept_to_the_bit(small_library: Library, shot: Shot) -> None:
    near = Rotation(308.0, 6.0)
    placed = Placement(Rasteriser(), refiner=Refiner(lite0()), refine="full").place(
        shot.photo, shot.box, shot.mask, small_library.mesh(shot.cad), near, turn=False
    )
    assert placed.pose.rotation == near
    assert placed.refinement is not None
    assert placed.refinement.score > placed.refinement.start_score


@pytest.mark.parametrize("words", [{"align_to": "eye"}, {"refine": "much"}, {"refine": "fast"}])
def test_unknown_words_are_refused(words: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"must be one of|needs a refiner"):
        Placement(Rasteriser(), **words)
