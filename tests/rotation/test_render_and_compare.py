from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from cadpose.encoder import SIDE, lite0
from cadpose.errors import LibraryError
from cadpose.geometry.angles import geodesic_degrees, rotation_from_angles
from cadpose.geometry.boxes import Box
from cadpose.geometry.camera import Cameras
from cadpose.geometry.frames import FloatArray
from cadpose.library.mesh import Mesh
from cadpose.photos import crop_square
from cadpose.records import CadModel, Rotation, Views
from cadpose.rendering.raster import Rasteriser
from cadpose.rotation import RotationEstimator
from cadpose.rotation.features import Described
from cadpose.rotation.gallery import GalleryStore
from cadpose.rotation.grid import grid_angles, grid_distances, grid_rotations
from cadpose.rotation.render_and_compare import RenderAndCompare, peaks
from tests.rotation.fakes import ColourEncoder, cad, car, random_described, van

N = len(grid_angles())


def no_render(model: CadModel, R_cv_from_s: FloatArray) -> Views:
    raise AssertionError("nothing should be drawn")


class Galleries(GalleryStore):
    """Random templates, counted."""

    def __init__(self, rotations: int) -> None:
        super().__init__(Path("nowhere"), ColourEncoder(), no_render, "raster")
        self.rotations = rotations
        self.asked: list[str] = []

    def get(self, cad: CadModel) -> Described:
        self.asked.append(cad.id)
        return random_described(self.rotations, len(cad.id))


def one_peak(angles: Sequence[float], width: float = 20.0) -> FloatArray:
    """(N,) scores that fall with the distance from a rotation."""
    distance = geodesic_degrees(rotation_from_angles(*angles), grid_rotations())
    return np.asarray(0.2 * np.exp(-((distance / width) ** 2)))


# -- peaks ----------------------------------------------------------------------------------------


@given(st.integers(0, 2**32 - 1), st.floats(1e-3, 0.3), st.integers(1, 12))
def test_peaks_keep_apart_and_fall(seed: int, scale: float, count: int) -> None:
    rng = np.random.default_rng(seed)
    # Neighbours alike, as real scores are.
    near = np.exp(-((grid_distances() / 15.0) ** 2))
    scores = near @ rng.normal(size=N) / near.sum(axis=1) * scale
    found = peaks(scores, count)
    assert 1 <= len(found) <= count
    assert found[0].score == scores.max()
    assert [h.score for h in found] == sorted((h.score for h in found), reverse=True)
    assert sum(h.probability for h in found) == pytest.approx(1.0)
    shares = [h.probability for h in found]
    assert shares == sorted(shares, reverse=True)
    for i, a in enumerate(found):
        for b in found[:i]:
            assert a.rotation.error_to(b.rotation) >= 25.0 - 1e-6
        # Each stays in the neighbourhood of the template whose score it carries.
        best = int(np.flatnonzero(scores == a.score)[0])
        assert a.rotation.error_to(Rotation(*grid_angles()[best])) <= 16.0 + 1e-6


def test_two_views_that_fit_give_two_hypotheses() -> None:
    scores = np.maximum(one_peak((40.0, 10.0, 0.0)), 0.9 * one_peak((220.0, 10.0, 0.0)))
    first, second = peaks(scores, 2)
    assert first.rotation.error_to(Rotation(40.0, 10.0)) < 3.0
    assert second.rotation.error_to(Rotation(220.0, 10.0)) < 3.0
    # exp(-0.02 / 0.02) to 1.
    assert second.probability / first.probability == pytest.approx(np.exp(-1.0), rel=1e-6)


@pytest.mark.parametrize("azimuth", [42.5, 87.0, 354.0])
def test_peaks_lie_between_grid_points(azimuth: float) -> None:
    estimate = peaks(one_peak((azimuth, 14.0, 0.0)), 1)[0].rotation
    true = Rotation(azimuth, 14.0)
    on_grid = min(true.error_to(Rotation(*row)) for row in grid_angles())
    assert true.error_to(estimate) < 0.7 * on_grid


def test_a_template_near_a_moved_peak_is_no_other_hypothesis() -> None:
    D, R = grid_distances(), grid_rotations()
    best = int(np.flatnonzero((grid_angles() == (90.0, 10.0, 0.0)).all(axis=1))[0])
    # Neighbours on one side score as well, which moves the peak there ...
    side = np.flatnonzero((D[best] < 16.0) & (grid_angles()[:, 0] > 90.0))
    scores = np.full(N, -1.0)
    scores[side], scores[best] = 0.999, 1.0
    moved = peaks(scores, 1)[0].rotation
    # ... nearer to templates that are far enough from the grid point.
    tempting = (D[best] >= 25.0) & (geodesic_degrees(moved.to_matrix(), R) < 24.0)
    assert tempting.any()
    scores[tempting] = 0.5
    first, second = peaks(scores, 2)
    assert first.rotation == moved
    assert first.rotation.error_to(second.rotation) >= 25.0 - 1e-6


def test_no_more_peaks_than_the_grid_has_room_for() -> None:
    found = peaks(np.zeros(N), 10_000)
    assert len(found) < N / 4
    assert sum(h.probability for h in found) == pytest.approx(1.0)


# -- the estimator --------------------------------------------------------------------------------


def test_without_a_model_there_is_nothing_to_compare() -> None:
    estimator = RenderAndCompare(Galleries(N), ColourEncoder())
    with pytest.raises(LibraryError, match="no CAD model"):
        estimator.estimate(np.zeros((SIDE, SIDE, 3), np.uint8), [])


def test_templates_are_kept_up_to_the_bytes_allowed() -> None:
    galleries = Galleries(8)
    size = _bytes_of(galleries)
    estimator = RenderAndCompare(galleries, ColourEncoder(), memory_bytes=int(2.5 * size))
    a, b, c = cad("a"), cad("bb"), cad("ccc")
    for model in (a, b, a):
        estimator._templates([model])
    assert galleries.asked == ["a", "bb"]
    # b was used before a, so c takes its place.
    estimator._templates([c])
    estimator._templates([a])
    assert galleries.asked == ["a", "bb", "ccc"]
    estimator._templates([b])
    assert galleries.asked == ["a", "bb", "ccc", "bb"]


def test_one_category_is_kept_even_where_it_exceeds_the_memory() -> None:
    galleries = Galleries(8)
    estimator = RenderAndCompare(galleries, ColourEncoder(), memory_bytes=1)
    estimator._templates([cad("a")])
    estimator._templates([cad("a")])
    assert galleries.asked == ["a"]
    estimator._templates([cad("bb")])
    estimator._templates([cad("a")])
    assert galleries.asked == ["a", "bb", "a"]


def test_a_changed_mesh_is_not_mistaken_for_the_old_one() -> None:
    galleries = Galleries(8)
    estimator = RenderAndCompare(galleries, ColourEncoder())
    estimator._templates([cad("a", "1")])
    estimator._templates([cad("a", "2")])
    assert galleries.asked == ["a", "a"]


def _bytes_of(galleries: Galleries) -> int:
    estimator = RenderAndCompare(galleries, ColourEncoder())
    size = estimator._templates([cad("zzzz")]).nbytes
    galleries.asked.clear()
    return size


# -- end to end with the real encoder -------------------------------------------------------------

#: Azimuths on and off the grid, all heights, in-plane to both sides.
VIEWS = [
    Rotation(azimuth, elevation, inplane)
    for azimuth, elevation, inplane in (
        (3, 8, 0), (33, 20, 20), (65, 5, 0), (94, 15, -20), (127, 30, 0), (155, 8, 10),
        (183, 12, 0), (214, 24, -20), (246, 3, 0), (275, 10, 20), (308, 18, 0), (336, 28, -10),
    )
]  # fmt: skip


@pytest.fixture(scope="module")
def meshes() -> dict[str, Mesh]:
    return {"saloon": car(), "van": van()}


@pytest.fixture(scope="module")
def estimator(tmp_path_factory: pytest.TempPathFactory, meshes: dict[str, Mesh]) -> RotationEstimator:
    renderer = Rasteriser()

    def framed(model: CadModel, R: FloatArray) -> Views:
        mesh = meshes[model.id]
        return renderer.render(mesh, Cameras.framing(R, mesh.hull, size=SIDE))

    folder = tmp_path_factory.mktemp("galleries")
    store = GalleryStore(folder, lite0(threads=1), framed, renderer.name, workers=2)
    return RenderAndCompare(store, lite0())


def photographed(mesh: Mesh, rotation: Rotation) -> NDArray[np.uint8]:
    """The crop of a photo in which the mesh stands somewhere before a plain wall."""
    cameras = Cameras.from_rotations(
        rotation.to_matrix(), focal_px=700.0, principal_px=(350.0, 230.0), width=640, height=480
    )
    view = Rasteriser().render(mesh, cameras)
    photo = np.where(view.alpha[0, ..., None] > 127, view.rgb[0], np.array([150, 170, 190], np.uint8))
    return crop_square(np.asarray(photo, np.uint8), Box.from_mask(view.mask[0]), SIDE)


def test_the_rotation_of_a_render_is_found(estimator: RotationEstimator, meshes: dict[str, Mesh]) -> None:
    cads = [cad("van"), cad("saloon")]
    errors = []
    for rotation in VIEWS:
        hypotheses = estimator.estimate(photographed(meshes["saloon"], rotation), cads)
        assert 1 <= len(hypotheses) <= 5
        errors.append(hypotheses[0].rotation.error_to(rotation))
    assert (np.array(errors) <= 15.0).sum() >= 10, np.round(errors, 1)
    assert np.median(errors) < 8.0, np.round(errors, 1)


def test_turning_the_picture_turns_the_answer(estimator: RotationEstimator, meshes: dict[str, Mesh]) -> None:
    cads = [cad("van"), cad("saloon")]
    turned = {
        inplane: estimator.estimate(photographed(meshes["van"], Rotation(50.0, 8.0, inplane)), cads)[0]
        for inplane in (-20.0, 0.0, 20.0)
    }
    for inplane, hypothesis in turned.items():
        assert hypothesis.rotation.inplane == pytest.approx(inplane, abs=10.0)
