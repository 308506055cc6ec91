from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np
import pytest

from cadpose.alignment.refinement.crop import ObjectCrop
from cadpose.alignment.refinement.network import Advice, RefinementNetwork
from cadpose.alignment.refinement.refine import BOUNDS, Refined, Refiner
from cadpose.alignment.refinement.steps import in_photo_camera
from cadpose.encoder import lite0
from cadpose.geometry.boxes import mask_iou
from cadpose.geometry.symmetry_groups import SymmetryGroup
from cadpose.library.catalogue import Library
from cadpose.poses import PhotoCamera, Pose4Dof, Pose6Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from tests.small_library import Shot, shoot

TRUE = Pose4Dof(Rotation(40.0, 12.0), 420.0, (210.0, 140.0))
START = Pose4Dof(Rotation(49.0, 8.0, 2.0), 445.0, (214.0, 137.0))


class Told(RefinementNetwork):
    """A network that says what it is told, call by call."""

    def __init__(self, steps: list[list[float]]) -> None:
        self.steps: Iterator[list[float]] = iter(steps)

    def advise(self, photo: object, view: object, cover: object) -> Advice:
        return Advice(np.array(next(self.steps)), 4.5)


@pytest.fixture(scope="module")
def shot(small_library: Library) -> Shot:
    return shoot(small_library, "made/car/hatch.obj", TRUE.rotation)


def refined(
    library: Library,
    shot: Shot,
    start: Pose4Dof,
    mode: str,
    network: RefinementNetwork | None,
    **more: object,
) -> Refined:
    crop = ObjectCrop.of(shot.photo.rgb, shot.box, shot.mask)
    render = partial(Rasteriser().render, library.mesh(shot.cad))
    return Refiner(lite0(), network).refine(crop, start, render, mode, **more)  # type: ignore[arg-type]


def overlap(library: Library, shot: Shot, pose: Pose4Dof) -> float:
    drawn = Rasteriser().render(library.mesh(shot.cad), pose.to_cameras(shot.photo.width, shot.photo.height))
    return mask_iou(drawn.mask[0], shot.mask)


def test_a_full_refinement_finds_the_pose_that_the_photo_was_drawn_with(
    small_library: Library, shot: Shot
) -> None:
    found = refined(small_library, shot, START, "full", None)
    assert START.rotation.error_to(TRUE.rotation) > 9.0
    assert found.pose.rotation.error_to(TRUE.rotation) < 3.0
    assert overlap(small_library, shot, found.pose) > 0.96 > overlap(small_library, shot, START)
    assert found.pose.focal_px == pytest.approx(TRUE.focal_px, rel=0.02)
    assert found.record.start == START
    assert found.record.score > found.record.start_score
    assert found.record.expected_error is None


def test_a_fast_one_without_advice_fits_focal_length_and_offset_alone(
    small_library: Library, shot: Shot
) -> None:
    start = Pose4Dof(TRUE.rotation, 470.0, (218.0, 134.0))
    found = refined(small_library, shot, start, "fast", None)
    assert found.pose.rotation.error_to(TRUE.rotation) < 1e-6
    assert found.pose.focal_px == pytest.approx(TRUE.focal_px, rel=0.01)
    np.testing.assert_allclose(found.pose.principal_px, TRUE.principal_px, atol=1.0)
    assert found.record.evaluations == 2


def test_good_advice_is_taken_and_bad_advice_is_not(small_library: Library, shot: Shot) -> None:
    nothing = [0.0] * 6
    back = TRUE.rotation.to_matrix() @ START.rotation.to_matrix().T
    angle = np.arccos((np.trace(back) - 1.0) / 2.0)
    axis = np.array([back[2, 1] - back[1, 2], back[0, 2] - back[2, 0], back[1, 0] - back[0, 1]])
    turn = [float(v) for v in axis / np.linalg.norm(axis) * angle]
    good = refined(small_library, shot, START, "fast", Told([[*turn, 0.0, 0.0, 0.0], nothing, nothing]))
    assert good.pose.rotation.error_to(TRUE.rotation) < 0.5
    assert good.record.expected_error == 4.5
    bad = refined(small_library, shot, TRUE, "fast", Told([[0.5, 1.0, 0.5, 0.3, 0.1, 0.1], nothing, nothing]))
    assert bad.pose.rotation.error_to(TRUE.rotation) < 0.5
    assert bad.record.score >= bad.record.start_score


def test_advice_that_cannot_be_drawn_ends_the_asking(small_library: Library, shot: Shot) -> None:
    near = Pose4Dof(TRUE.rotation, 420.0, (210.0, 140.0))

    def render(cameras: object) -> object:
        raise ValueError("behind the camera")

    crop = ObjectCrop.of(shot.photo.rgb, shot.box, shot.mask)
    with pytest.raises(ValueError, match="behind"):
        Refiner(lite0()).refine(crop, near, render)  # type: ignore[arg-type]


def test_one_step_of_the_network_stays_within_bounds(small_library: Library, shot: Shot) -> None:
    nothing = [0.0] * 6
    wild = [2.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    start = Pose4Dof(Rotation(40.0, 12.0 + np.degrees(BOUNDS[0])), TRUE.focal_px, TRUE.principal_px)
    back = start.rotation.error_to(TRUE.rotation)
    found = refined(small_library, shot, start, "fast", Told([wild, nothing, nothing]))
    assert start.rotation.error_to(found.pose.rotation) <= np.degrees(BOUNDS[0]) + 1e-6
    assert back == pytest.approx(np.degrees(BOUNDS[0]))


def test_a_body_of_revolution_is_never_turned_about_its_axis(small_library: Library, shot: Shot) -> None:
    axis = TRUE.rotation.to_matrix() @ [0.0, 1.0, 0.0]
    advice = [*(0.3 * axis), 0.0, 0.0, 0.0]
    network = Told([advice, advice, advice])
    found = refined(small_library, shot, TRUE, "fast", network, symmetry=SymmetryGroup.revolution())
    assert found.pose.rotation.error_to(TRUE.rotation) < 1e-4


def test_in_the_photos_camera_the_real_perspective_is_found(small_library: Library) -> None:
    # Photographed from five diagonals: what two diagonals show of it has another perspective.
    camera = PhotoCamera(1000.0, (200.0, 150.0))
    whole = Pose6Dof(Rotation(40.0, 12.0).to_matrix(), np.array([0.05, -0.05, 5.0]), camera)
    shot = shoot(small_library, "made/car/hatch.obj", TRUE.rotation)
    mesh = small_library.mesh(shot.cad)
    views = Rasteriser().render(mesh, whole.to_cameras(400, 300))
    rgb, mask = views.over(180)[0], views.mask[0]
    crop = ObjectCrop.of(rgb, shot.box.around(shot.box), mask)
    render = partial(Rasteriser().render, mesh)
    start = whole.to_4dof()
    off = Pose4Dof(
        Rotation(start.rotation.azimuth + 6.0, start.rotation.elevation),
        start.focal_px * 1.05,
        start.principal_px,
    )
    found = Refiner(lite0()).refine(crop, off, render, "full", seen=in_photo_camera(camera))
    back = Pose6Dof.from_4dof(found.pose, camera)
    drawn = Rasteriser().render(mesh, back.to_cameras(400, 300)).mask[0]
    assert mask_iou(drawn, mask) > 0.97
    assert back.t_cv[2] == pytest.approx(5.0, rel=0.03)


def test_other_modes_are_refused(small_library: Library, shot: Shot) -> None:
    with pytest.raises(ValueError, match="fast or full"):
        refined(small_library, shot, START, "off", None)
