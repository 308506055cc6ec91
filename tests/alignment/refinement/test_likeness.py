from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cadpose.alignment.refinement.crop import ObjectCrop
from cadpose.alignment.refinement.likeness import Likeness, Weights
from cadpose.encoder import SIDE, lite0
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Views
from cadpose.rendering.raster import Rasteriser
from tests.small_library import shoot

TRUE = Pose4Dof(Rotation(40.0, 12.0), 420.0, (210.0, 140.0))


def views_of(library: Library, crop: ObjectCrop, pose: Pose4Dof) -> Views:
    return Rasteriser().render(library.mesh("made/car/hatch.obj"), crop.cameras(pose.to_cameras(1, 1)))


@pytest.mark.parametrize(
    "weights", [Weights(1.0, 0.0, 0.0), Weights(0.0, 1.0, 0.0), Weights(0.0, 0.0, 1.0), Weights()]
)
def test_every_part_is_highest_at_the_true_pose(small_library: Library, weights: Weights) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE.rotation)
    crop = ObjectCrop.of(shot.photo.rgb, shot.box, shot.mask)
    likeness = Likeness(crop, lite0(), weights)
    true = likeness.of(views_of(small_library, crop, TRUE)).score
    others = [
        replace(TRUE, rotation=Rotation(60.0, 12.0)),
        replace(TRUE, rotation=Rotation(220.0, 12.0)),
        replace(TRUE, focal_px=480.0),
        replace(TRUE, principal_px=(230.0, 140.0)),
    ]
    assert all(likeness.of(views_of(small_library, crop, pose)).score < true for pose in others)


def test_without_a_mask_the_features_decide(small_library: Library) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE.rotation)
    crop = ObjectCrop.of(shot.photo.rgb, shot.box)
    likeness = Likeness(crop, lite0())
    look = likeness.of(views_of(small_library, crop, TRUE))
    assert likeness.of_silhouette(look.alpha) == 0.0
    assert -1.0 <= look.score <= 1.0


def test_what_lies_beyond_the_photo_does_not_count(small_library: Library) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE.rotation)
    crop = ObjectCrop.of(shot.photo.rgb, shot.box, shot.mask)
    half = replace(crop, inside=np.arange(SIDE)[None, :] < SIDE // 2 + np.zeros((SIDE, 1), int))
    alpha = views_of(small_library, crop, TRUE).alpha[0] / np.float32(255.0)
    cut = alpha.copy()
    cut[:, SIDE // 2 :] = 0.0
    likeness = Likeness(replace(half, mask=cut), lite0())
    assert likeness.of_silhouette(alpha) == pytest.approx(likeness.of_silhouette(cut))


def test_a_view_of_another_size_is_refused(small_library: Library) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", TRUE.rotation)
    likeness = Likeness(ObjectCrop.of(shot.photo.rgb, shot.box), lite0())
    views = Rasteriser().render(small_library.mesh("made/car/hatch.obj"), TRUE.to_cameras(100, 90))
    with pytest.raises(ValueError, match="expected a view"):
        likeness.of(views)
