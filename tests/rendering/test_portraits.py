from __future__ import annotations

import numpy as np
import pytest

from cadpose.errors import LibraryError
from cadpose.geometry.camera import Cameras
from cadpose.library.catalogue import Library
from cadpose.library.mesh import Mesh
from cadpose.records import CadModel, Views
from cadpose.rendering.portraits import portraits
from cadpose.rendering.raster import Rasteriser


def test_each_model_fills_its_square(small_library: Library) -> None:
    models = small_library.models()
    drawn = list(portraits(small_library, models, size=96))
    assert [model for model, _ in drawn] == list(models)
    for _, picture in drawn:
        assert picture.shape == (96, 96, 3) and picture.dtype == np.uint8
        rows, columns = np.nonzero((picture < 250).any(axis=2))
        height, width = np.ptp(rows) + 1, np.ptp(columns) + 1
        assert 0.85 * 96 < max(height, width) < 0.97 * 96, "a margin around the longer side"
        assert abs(rows.min() + rows.max() - 95) <= 3 and abs(columns.min() + columns.max() - 95) <= 3
        assert (picture[0] == 255).all() and (picture[:, 0] == 255).all()


def test_angles_and_renderer_are_taken(small_library: Library) -> None:
    model = small_library.get("made/car/pickup.obj")
    ((_, front),) = portraits(small_library, [model], 0.0, 0.0)
    ((_, side),) = portraits(small_library, [model], 90.0, 0.0)
    ((_, again),) = portraits(small_library, [model], 360.0, 0.0)
    assert front.shape == (176, 176, 3) and np.array_equal(front, again)
    heights = [len(np.unique(np.nonzero(picture < 250)[0])) for picture in (front, side)]
    assert heights[0] > 1.5 * heights[1], "a pickup is taller for its width from the front"

    class Counting(Rasteriser):
        calls = 0

        def render(self, mesh: Mesh, cameras: Cameras) -> Views:
            Counting.calls += 1
            return super().render(mesh, cameras)

    list(portraits(small_library, small_library.models(), renderer=Counting()))
    assert Counting.calls == len(small_library.models())


def test_models_are_drawn_as_they_are_asked_for(small_library: Library) -> None:
    pictures = portraits(small_library, [*small_library.models("chair"), CadModel("gone", "gone", "chair")])
    next(pictures)
    next(pictures)
    with pytest.raises(LibraryError, match="'gone'"):
        next(pictures)
