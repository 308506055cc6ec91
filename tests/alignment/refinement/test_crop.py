from __future__ import annotations

import numpy as np
import pytest

from cadpose.alignment.refinement.crop import BACKGROUND, CONTEXT, ObjectCrop
from cadpose.encoder import SIDE
from cadpose.geometry.boxes import Box
from cadpose.library.catalogue import Library
from cadpose.poses import Pose4Dof, Rotation
from cadpose.rendering.raster import Rasteriser
from tests.small_library import shoot


def test_a_model_drawn_for_the_crop_lies_on_its_photo(small_library: Library) -> None:
    shot = shoot(small_library, "made/car/hatch.obj", Rotation(40.0, 12.0))
    crop = ObjectCrop.of(shot.photo.rgb, shot.box, shot.mask)
    pose = Pose4Dof(shot.rotation, shot.focal_px, (210.0, 140.0))
    cameras = crop.cameras(pose.to_cameras(1, 1))
    drawn = Rasteriser().render(small_library.mesh(shot.cad), cameras).alpha[0] / 255.0
    assert crop.mask is not None
    assert np.minimum(drawn, crop.mask).sum() / np.maximum(drawn, crop.mask).sum() > 0.97
    assert crop.square.width == pytest.approx(CONTEXT * max(shot.box.width, shot.box.height))


def test_beyond_the_photo_it_is_grey_and_unknown() -> None:
    rgb = np.full((100, 100, 3), 200, np.uint8)
    crop = ObjectCrop.of(rgb, Box(60.0, 20.0, 100.0, 80.0))
    assert crop.mask is None
    beyond = ~crop.inside
    assert 0.1 < beyond.mean() < 0.3
    assert (crop.rgb[:, -5:] == BACKGROUND).all()
    assert not crop.inside[:, -5:].any()
    assert crop.inside[:, : SIDE // 2].all()


def test_a_mask_of_another_size_is_refused() -> None:
    with pytest.raises(ValueError, match="does not fit"):
        ObjectCrop.of(np.zeros((10, 12, 3), np.uint8), Box(0, 0, 12, 10), np.zeros((12, 10), np.bool_))
