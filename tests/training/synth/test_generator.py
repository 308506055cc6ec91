"""Labels are exact, photos depend on seed and number alone, and options are kept to."""

from __future__ import annotations

import numpy as np
import pytest

from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.records import Pose4Dof
from cadpose.rendering.raster import Rasteriser
from cadpose.training.synth.backdrops import Backdrops
from cadpose.training.synth.generator import LEAST_VISIBLE, SynthGenerator
from cadpose.training.synth.records import SynthObject
from tests.training.synth.making import PLAIN, generator_of


def projected(found: SynthObject, library: Library) -> np.ndarray:
    """(V, 2) pixels of the model's vertices, by K, R and t alone."""
    x_cv = library.mesh(found.cad).vertices @ found.rotation.to_matrix().T + (0.0, 0.0, found.t_z)
    homogeneous = x_cv @ found.K.T
    return np.asarray(homogeneous[:, :2] / homogeneous[:, 2:])


def test_the_projected_model_fills_its_box_and_its_mask(small_library: Library) -> None:
    generator = generator_of(small_library, **PLAIN)
    for index in range(24):
        (found,) = generator.photo(index).objects
        pixels = projected(found, small_library)
        corners = [*pixels.min(axis=0), *pixels.max(axis=0)]
        np.testing.assert_allclose(corners, found.box.to_tuple(), atol=0.02)
        # A pixel counts when half of it is covered: the mask may end up to a pixel before the outline.
        np.testing.assert_allclose(found.visible_box.to_tuple(), corners, atol=1.3)
        inside = pixels.astype(int).clip(0, 95)
        grown = np.pad(found.mask, 1)
        grown = np.any(
            [grown[1 + y : 97 + y, 1 + x : 97 + x] for y in (-1, 0, 1) for x in (-1, 0, 1)], axis=0
        )
        assert grown[inside[:, 1], inside[:, 0]].all()


def test_the_mask_is_the_model_drawn_again(small_library: Library) -> None:
    generator = generator_of(small_library, **PLAIN)
    for index in range(12):
        (found,) = generator.photo(index).objects
        cameras = _cameras(found, 96)
        again = Rasteriser().render(small_library.mesh(found.cad), cameras).mask[0]
        # The angles are written and read back; nothing else is between the two.
        assert (again != found.mask).sum() <= 2


def _cameras(found: SynthObject, size: int) -> Cameras:
    return Pose4Dof(found.rotation, found.focal_px, found.principal_px, found.t_z).to_cameras(size, size)


def test_warped_shapes_still_fill_their_boxes(small_library: Library) -> None:
    generator = generator_of(small_library, **{**PLAIN, "warp": 1.0})
    for index in range(24):
        (found,) = generator.photo(index).objects
        np.testing.assert_allclose(found.visible_box.to_tuple(), found.box.to_tuple(), atol=1.3)
        assert not found.truncated and not found.occluded and found.visible > 0.9


def test_a_photo_is_the_same_in_whatever_order(small_library: Library) -> None:
    forth = generator_of(small_library)
    back = generator_of(small_library)
    photos = [forth.photo(i) for i in range(14)]
    for i in (13, 2, 0, 7, 12, 3):
        again = back.photo(i)
        assert np.array_equal(again.rgb, photos[i].rgb)
        assert [o.rotation for o in again.objects] == [o.rotation for o in photos[i].objects]
        assert [o.cad for o in again.objects] == [o.cad for o in photos[i].objects]


def test_another_seed_and_another_number_draw_another_photo(small_library: Library) -> None:
    first, other = generator_of(small_library), generator_of(small_library, seed=4)
    assert not np.array_equal(first.photo(0).rgb, other.photo(0).rgb)
    assert not np.array_equal(first.photo(0).rgb, first.photo(1).rgb)


def test_without_company_and_truncation_there_is_one_whole_object(small_library: Library) -> None:
    generator = generator_of(small_library, company=0.0, truncate=0.0, occluder=0.0)
    for index in range(40):
        (found,) = generator.photo(index).objects
        assert not found.truncated


def test_with_company_and_truncation_there_are_more(small_library: Library) -> None:
    generator = generator_of(small_library, company=1.0, truncate=1.0, occluder=0.0)
    photos = [generator.photo(i) for i in range(40)]
    assert any(len(p.objects) > 1 for p in photos)
    found = [o for p in photos for o in p.objects]
    assert any(o.truncated for o in found) and any(o.occluded for o in found)
    assert all(LEAST_VISIBLE <= o.visible <= 1.0 and 0.0 <= o.hidden < 1.0 for o in found)
    for photo in photos:
        # What is seen of one object is not seen of another.
        assert np.sum([o.mask for o in photo.objects], axis=0).max(initial=0) <= 1


def test_covers_hide_main_objects(small_library: Library) -> None:
    generator = generator_of(small_library, **{**PLAIN, "occluder": 1.0})
    found = [o for i in range(30) for o in generator.photo(i).objects]
    hidden = [o for o in found if o.occluded]
    assert len(hidden) > 5
    assert all(o.mask.sum() > 0 and o.visible < 1.0 for o in hidden)


def test_categories_are_weighted(small_library: Library) -> None:
    generator = generator_of(small_library, weights={"car": 0.0, "chair": 1.0}, series=1, shapes=1)
    assert {o.category for i in range(12) for o in generator.photo(i).objects} == {"chair"}


def test_a_generator_needs_a_model(small_library: Library) -> None:
    with pytest.raises(ValueError, match="at least one"):
        SynthGenerator([], small_library.mesh, small_library.symmetry, Backdrops())
