from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import Delaunay

from cadpose.geometry.angles import rotation_from_angles
from cadpose.geometry.camera import Cameras, projected_rectangle
from cadpose.library.mesh import Material
from cadpose.records import Views
from cadpose.rendering import shading, unsnapped, visibility
from cadpose.rendering.raster import Rasteriser
from tests.rendering.shapes import (
    BLUE,
    FRONT,
    GREEN,
    QUAD_UV,
    RED,
    cube,
    front_camera,
    mesh_of,
    quad,
    sphere,
)

ANGLES = ((0.0, 0.0, 0.0), (35.0, 20.0, 10.0), (140.0, -30.0, -25.0), (270.0, 80.0, 0.0))
POSES = np.stack([rotation_from_angles(*a) for a in ANGLES])


def texture_of(*rows: list[tuple[int, ...]], scale: int = 8) -> np.ndarray:
    return np.kron(np.array(rows, np.uint8), np.ones((scale, scale, 1), np.uint8))


def same(a: Views, b: Views) -> bool:
    return all(np.array_equal(getattr(a, k), getattr(b, k)) for k in ("rgb", "alpha", "depth"))


# Shapes known exactly


@pytest.mark.parametrize("supersample", [1, 2, 3])
def test_a_sphere_covers_its_analytic_disc(supersample: int) -> None:
    views = Rasteriser(supersample).render(sphere(0.4, rings=96), front_camera(256, 480.0))
    radius = 480.0 * 0.4 / np.sqrt(2.0**2 - 0.4**2)
    assert views.alpha.sum() / 255 == pytest.approx(np.pi * radius**2, rel=0.003)
    rows, columns = np.nonzero(views.mask[0])
    assert rows.mean() + 0.5 == pytest.approx(128, abs=0.1)
    assert columns.mean() + 0.5 == pytest.approx(128, abs=0.1)
    assert views.depth.min() == pytest.approx(1.6, abs=0.002)


@pytest.mark.parametrize("supersample", [1, 2])
def test_mask_fits_the_projected_rectangle(supersample: int) -> None:
    mesh = cube()
    cameras = Cameras.framing(POSES, mesh.hull, size=160, margin=0.07)
    views = Rasteriser(supersample).render(mesh, cameras)
    rectangles = projected_rectangle(POSES, mesh.hull) * cameras.focal_px[:, None]
    rectangles += np.tile(cameras.principal_px, 2)
    for alpha, rectangle in zip(views.alpha, rectangles, strict=True):
        rows, columns = np.nonzero(alpha)
        box = [columns.min(), rows.min(), columns.max() + 1, rows.max() + 1]
        assert np.abs(np.array(box) - rectangle).max() < 1.0


def test_the_cube_s_corners_are_where_the_camera_projects_them() -> None:
    mesh = cube(0.4)
    cameras = front_camera(128, 300.0)
    mask = Rasteriser(1).render(mesh, cameras).mask[0]
    # In the front view only the near face is seen: a square from exact corners.
    x0, y0 = cameras.project(np.array([[0.2, 0.2, -0.2]]))[0, 0]
    x1, y1 = cameras.project(np.array([[-0.2, -0.2, -0.2]]))[0, 0]
    centre = np.arange(128) + 0.5
    expected = ((centre > y0) & (centre < y1))[:, None] & ((centre > x0) & (centre < x1))
    assert np.array_equal(mask, expected)


@pytest.mark.parametrize("supersample", [1, 2])
def test_depth_is_that_of_the_pixel_s_centre(supersample: int) -> None:
    # The plane z = 0.3 x + 0.2 y in the camera frame, about t_z = 2.
    square = quad(0.0, 0.5)
    square[..., 2] = -0.3 * square[..., 0] - 0.2 * square[..., 1]
    views = Rasteriser(supersample).render(mesh_of(square), front_camera(64, 200.0))
    u = (np.arange(64) + 0.5 - 32) / 200.0
    exact = 2.0 / (1.0 - 0.3 * u[None, :] - 0.2 * u[:, None])
    inside = views.alpha[0] == 255
    assert inside.sum() > 1000
    np.testing.assert_allclose(views.depth[0][inside], exact[inside], rtol=1e-6)
    assert np.isinf(views.depth[0][views.alpha[0] == 0]).all()


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1), st.booleans(), st.sampled_from([1, 2]))
def test_triangles_that_share_edges_cover_each_sample_once(seed: int, lattice: bool, ss: int) -> None:
    """The fill rule, on a triangulated square; on the lattice every vertex lies on a sample."""
    rng = np.random.default_rng(seed)
    size, focal = 16, 128.0
    inner = rng.uniform(2, 14, (8, 2))
    border = np.array([[2, 2], [14, 2], [14, 14], [2, 14]], float)
    pixels = np.concatenate([border, inner])
    if lattice:
        pixels = np.unique(np.floor(pixels) + 0.5 / ss, axis=0)
    triangles = pixels[Delaunay(pixels).simplices]
    # Back-project to z = 2 with the front camera: x_s = -x_cv, y_s = -y_cv.
    points = -(triangles - size / 2) / focal * 2.0
    points = np.concatenate([points, np.zeros((*points.shape[:2], 1))], axis=2)
    flip = rng.random(len(points)) < 0.5
    points[flip] = points[flip][:, ::-1]
    rasteriser, cameras = Rasteriser(ss), front_camera(size, focal)
    whole = rasteriser.render(mesh_of(points), cameras).alpha[0].astype(int)
    # Rounded up to 255 per view: count samples instead.
    per_sample = 255 / ss**2
    parts = sum(
        np.rint(rasteriser.render(mesh_of(p[None]), cameras).alpha[0] / per_sample).astype(int)
        for p in points
    )
    assert np.array_equal(parts, np.rint(whole / per_sample))
    assert parts.max() == ss**2


def test_supersampled_coverage_is_the_exact_area() -> None:
    rng = np.random.default_rng(5)
    errors = {1: [], 2: []}  # type: dict[int, list[float]]
    for _ in range(60):
        pixels = rng.uniform(4, 60, (3, 2))
        points = np.zeros((1, 3, 3))
        points[0, :, :2] = -(pixels - 32) / 200.0 * 2.0
        (ax, ay), (bx, by) = pixels[1] - pixels[0], pixels[2] - pixels[0]
        area = abs(ax * by - ay * bx) / 2
        for ss, error in errors.items():
            alpha = Rasteriser(ss).render(mesh_of(points), front_camera()).alpha
            error.append(alpha.sum() / 255 - area)
    assert np.abs(np.mean(errors[2])) < 0.5
    assert np.std(errors[2]) < 0.75 * np.std(errors[1])
    assert np.abs(errors[2]).max() < 4.0


# Order, sides, materials


@pytest.mark.parametrize("supersample", [1, 2])
@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_the_nearer_face_wins_whatever_the_order(order: list[int], supersample: int) -> None:
    near, far = quad(-0.3), quad(0.3)
    triangles = np.concatenate([(near, far)[i] for i in order])
    face_material = np.repeat(order, 2)
    views = Rasteriser(supersample).render(
        mesh_of(triangles, (Material(RED), Material(GREEN)), face_material), front_camera()
    )
    assert views.rgb[0, 32, 32, 0] > 150
    assert views.rgb[0, 32, 32, 1] == 0
    assert views.depth[0, 32, 32] == pytest.approx(1.7)


def test_intersecting_faces_part_where_they_meet() -> None:
    tilted = quad(0.0)
    tilted[..., 2] = tilted[..., 0]  # image left (+x) is farther than z = 0
    triangles = np.concatenate([tilted, quad(0.0)])
    views = Rasteriser(1).render(
        mesh_of(triangles, (Material(RED), Material(GREEN)), [0, 0, 1, 1]), front_camera()
    )
    assert (views.rgb[0, 32, 34:48, 0] > 0).all()
    assert (views.rgb[0, 32, 18:30, 1] > 0).all()


def test_both_sides_look_the_same() -> None:
    mesh, turned = mesh_of(quad(0.0)), mesh_of(quad(0.0)[:, ::-1])
    assert same(Rasteriser().render(mesh, front_camera()), Rasteriser().render(turned, front_camera()))


def test_smooth_normals_shade_smoothly_and_face_normals_flatly() -> None:
    ball = sphere(0.4, rings=12)
    corners = ball.vertices[ball.faces]
    keep = (
        np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) > 1e-9
    )
    flat = mesh_of(corners[keep])
    camera = front_camera(128, 300.0)
    levels = [len(np.unique(Rasteriser(1).render(m, camera).rgb[0][40:88, 40:88, 0])) for m in (ball, flat)]
    assert levels[0] > 1.5 * levels[1]


def test_light_comes_from_the_upper_left_of_the_camera() -> None:
    for angles in ANGLES:
        R = rotation_from_angles(*angles)
        camera = Cameras.from_rotations(R, focal_px=300.0, width=128, height=128)
        grey = Rasteriser(1).render(sphere(), camera).rgb[0, ..., 0].astype(int)
        assert grey[40, 40] > grey[40, 88] > grey[88, 88] > 60


@pytest.mark.parametrize("supersample", [1, 2])
def test_texture_is_the_right_way_up(supersample: int) -> None:
    # First row of the image is the top, v = 1.
    texture = texture_of([(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)])
    mesh = mesh_of(quad(0.0), (Material((1, 1, 1, 1), texture),), uv=QUAD_UV)
    rgb = Rasteriser(supersample).render(mesh, front_camera()).rgb[0]
    lit = [np.flatnonzero(rgb[r, c] > 100).tolist() for r, c in ((20, 20), (20, 44), (44, 20), (44, 44))]
    assert lit == [[0], [1], [2], [0, 1, 2]]


def test_texture_repeats_and_is_perspective_correct() -> None:
    texture = texture_of([(255, 255, 255), (0, 0, 0)], scale=16)
    floor = quad(0.0, 0.4)
    floor[..., 2] = 1.5 * floor[..., 0]  # turned about the vertical axis
    mesh = mesh_of(floor, (Material((1, 1, 1, 1), texture),), uv=QUAD_UV * [4, 1] + [7, -3])
    row = Rasteriser(1).render(mesh, front_camera(256, 500.0)).rgb[0, 128, :, 0]
    u = (np.arange(256) + 0.5 - 128) / 500.0
    # Ray x = u z meets z = 2 + 1.5 x_s = 2 - 1.5 x, so x = 2u / (1 + 1.5u); uv from image left (x_s = 0.4).
    x_s = -2.0 * u / (1.0 + 1.5 * u)
    phase = ((0.4 - x_s) / 0.8 * 4) % 1.0
    inside = (np.abs(x_s) < 0.39) & (np.abs(phase % 0.5 - 0.25) < 0.2)
    assert inside.sum() > 80
    assert np.array_equal(row[inside] > 60, phase[inside] < 0.5)


def test_a_fine_texture_is_averaged_rather_than_aliased() -> None:
    fine = np.tile(
        texture_of([(255, 255, 255), (0, 0, 0)], [(0, 0, 0), (255, 255, 255)], scale=1), (256, 256, 1)
    )
    mesh = mesh_of(quad(0.0), (Material((1, 1, 1, 1), fine),), uv=QUAD_UV)
    plain = mesh_of(quad(0.0), (Material((0.5, 0.5, 0.5, 1)),))
    rgb = [Rasteriser(1).render(m, front_camera()).rgb[0, 20:44, 20:44, 0].astype(int) for m in (mesh, plain)]
    assert rgb[0].std() < 3
    assert abs(rgb[0].mean() - rgb[1].mean()) < 4


def test_texture_without_coordinates_shows_its_mean_colour() -> None:
    texture = texture_of([(200, 0, 0), (0, 0, 200)])
    rgb = Rasteriser(1).render(mesh_of(quad(0.0), (Material((1, 1, 1, 1), texture),)), front_camera()).rgb
    red, green, blue = rgb[0, 32, 32].astype(int)
    assert green == 0
    assert abs(red - blue) <= 2
    assert red > 60


@pytest.mark.parametrize("supersample", [1, 2])
def test_glass_tints_what_is_behind_and_counts_as_covered(supersample: int) -> None:
    glass = Material((1.0, 0.0, 0.0, 0.25))
    both = mesh_of(np.concatenate([quad(-0.3), quad(0.3)]), (glass, Material(GREEN)), [0, 0, 1, 1])
    only = mesh_of(quad(-0.3), (glass,))
    opaque = mesh_of(quad(-0.3), (Material(RED),))
    behind = mesh_of(quad(0.3), (Material(GREEN),))
    hidden = mesh_of(np.concatenate([quad(0.5), quad(0.3)]), (glass, Material(GREEN)), [0, 0, 1, 1])
    camera, rasteriser = front_camera(), Rasteriser(supersample)
    r, g = (rasteriser.render(m, camera) for m in (opaque, behind))
    views = rasteriser.render(both, camera)
    expected = 0.25 * r.rgb[0, 32, 32] + 0.75 * g.rgb[0, 32, 32]
    np.testing.assert_allclose(views.rgb[0, 32, 32], expected, atol=1)
    assert views.depth[0, 32, 32] == pytest.approx(1.7)
    alone = rasteriser.render(only, camera)
    assert np.array_equal(alone.alpha, r.alpha)
    np.testing.assert_allclose(alone.rgb[0, 32, 32], r.rgb[0, 32, 32], atol=1)
    np.testing.assert_allclose(alone.depth, r.depth, rtol=1e-6)
    assert np.array_equal(rasteriser.render(hidden, camera).rgb[0, 32, 32], g.rgb[0, 32, 32])


@pytest.mark.parametrize("supersample", [1, 2])
def test_holes_in_a_texture_are_cut_out(supersample: int) -> None:
    texture = texture_of([(255, 0, 0, 255), (0, 0, 0, 0)])
    materials = (Material((1, 1, 1, 1), texture), Material(BLUE))
    leaf = mesh_of(quad(-0.1), materials, uv=QUAD_UV)
    turned = mesh_of(quad(-0.1)[:, ::-1], materials, uv=QUAD_UV[:, ::-1])
    views = Rasteriser(supersample).render(leaf, front_camera())
    assert views.alpha[0, 32, 24] == 255
    assert views.alpha[0, 32, 40] == 0
    assert same(views, Rasteriser(supersample).render(turned, front_camera()))
    backed = mesh_of(
        np.concatenate([quad(-0.1), quad(0.1)]), materials, [0, 0, 1, 1], np.concatenate([QUAD_UV, QUAD_UV])
    )
    rgb = Rasteriser(supersample).render(backed, front_camera()).rgb[0, 32]
    assert rgb[24, 0] > 100
    assert rgb[40, 2] > 100


def test_an_invisible_material_is_not_drawn() -> None:
    mesh = mesh_of(
        np.concatenate([quad(-0.3), quad(0.3)]), (Material((1, 0, 0, 0)), Material(GREEN)), [0, 0, 1, 1]
    )
    views = Rasteriser().render(mesh, front_camera())
    assert views.rgb[0, 32, 32, 0] == 0
    assert views.depth[0, 32, 32] == pytest.approx(2.3)
    assert not Rasteriser().render(mesh_of(quad(0.0), (Material((1, 0, 0, 0)),)), front_camera()).alpha.any()


# Cameras


@pytest.mark.parametrize("supersample", [1, 2])
def test_moving_the_principal_point_moves_the_picture(supersample: int) -> None:
    mesh, rasteriser = sphere(0.1), Rasteriser(supersample)
    centred = rasteriser.render(mesh, front_camera(96, 200.0))
    moved = rasteriser.render(mesh, front_camera(96, 200.0, principal=(48.0 + 17, 48.0 - 11)))
    for name in ("rgb", "alpha", "depth"):
        a, b = getattr(centred, name)[0], getattr(moved, name)[0]
        assert np.array_equal(np.roll(a, (-11, 17), (0, 1)), b)


def test_a_picture_need_not_be_square_nor_hold_the_object() -> None:
    cameras = Cameras.from_rotations(FRONT, focal_px=200.0, width=40, height=90, principal_px=(0.0, 45.0))
    views = Rasteriser().render(sphere(0.2), cameras)
    assert views.alpha.shape == (1, 90, 40)
    assert views.alpha[0, 45, 0] == 255
    away = Cameras.from_rotations(FRONT, focal_px=200.0, width=40, height=90, principal_px=(-500.0, 45.0))
    assert not Rasteriser().render(sphere(0.2), away).alpha.any()


@pytest.mark.parametrize("supersample", [1, 2])
def test_what_reaches_behind_the_camera_is_cut_off(supersample: int) -> None:
    # A floor one unit below the camera, from far behind it to far in front.
    a, b, c, d = (30.0, -1.0, -50.0), (-30.0, -1.0, -50.0), (-30.0, -1.0, 50.0), (30.0, -1.0, 50.0)
    views = Rasteriser(supersample).render(mesh_of([[a, b, c], [a, c, d]]), front_camera(64, 40.0))
    assert (views.alpha[0, 34:] == 255).all()
    assert not views.alpha[0, :32].any()
    v = (np.arange(64) + 0.5 - 32) / 40.0
    np.testing.assert_allclose(views.depth[0, 34:, 10], 1.0 / v[34:], rtol=1e-5)
    behind = mesh_of(quad(-3.0))
    assert not Rasteriser(supersample).render(behind, front_camera()).alpha.any()


def test_vertices_far_out_of_the_image_are_no_matter() -> None:
    huge = mesh_of(quad(0.0, 1e5))
    views = Rasteriser(1).render(huge, front_camera())
    assert (views.alpha == 255).all()
    np.testing.assert_allclose(views.depth, 2.0, rtol=1e-6)


def test_faces_without_area_are_no_matter() -> None:
    triangles = np.concatenate([quad(0.0), np.zeros((1, 3, 3)), np.full((1, 3, 3), 0.05)])
    views = Rasteriser().render(mesh_of(triangles), front_camera())
    assert same(views, Rasteriser().render(mesh_of(quad(0.0)), front_camera()))


# Batches


@pytest.mark.parametrize("supersample", [1, 2])
def test_a_batch_is_its_views_and_the_same_every_time(supersample: int) -> None:
    mesh = cube()
    cameras = Cameras.framing(POSES, mesh.hull, size=96)
    rasteriser = Rasteriser(supersample)
    batch = rasteriser.render(mesh, cameras)
    rasteriser.render(sphere(), front_camera(200, 900.0))  # leaves its traces in the scratch buffers
    assert same(batch, rasteriser.render(mesh, cameras))
    assert same(batch, Rasteriser(supersample).render(mesh, cameras))
    for i in range(len(cameras)):
        one = Rasteriser(supersample).render(mesh, cameras[i])
        for name in ("rgb", "alpha", "depth"):
            assert np.array_equal(getattr(one, name)[0], getattr(batch, name)[i])


def test_threads_may_share_a_rasteriser() -> None:
    mesh, rasteriser = sphere(), Rasteriser()
    cameras = Cameras.framing(POSES, mesh.hull, size=128)
    expected = rasteriser.render(mesh, cameras)
    with ThreadPoolExecutor(4) as pool:
        for views in pool.map(lambda _: rasteriser.render(mesh, cameras), range(16)):
            assert same(views, expected)


def test_no_cameras_no_views() -> None:
    assert len(Rasteriser().render(cube(), front_camera()[0:0])) == 0


def test_alpha_is_coverage_in_steps_and_rgb_is_black_outside() -> None:
    views = Rasteriser(2).render(sphere(), front_camera(128, 250.0))
    assert set(np.unique(views.alpha)) == {0, 64, 128, 191, 255}
    assert not views.rgb[views.alpha == 0].any()
    assert views.rgb[views.alpha == 64].min() > 40  # not multiplied by alpha


@pytest.mark.parametrize("bad", [0, 5, -1])
def test_supersample_out_of_range_is_refused(bad: int) -> None:
    with pytest.raises(ValueError, match="supersample"):
        Rasteriser(bad)


def test_an_image_beyond_the_fixed_point_range_is_refused() -> None:
    camera = Cameras.from_rotations(FRONT, focal_px=1.0, width=20000, height=1)
    with pytest.raises(ValueError, match="too many"):
        Rasteriser(1).render(cube(), camera)


def test_constants_that_kernels_mirror_agree() -> None:
    from cadpose.rendering import scene

    assert shading._ID_MAX == unsnapped._ID_MAX == visibility.ID_MAX
    assert (unsnapped._NEAR, unsnapped._W_TO_WORD) == (visibility.NEAR, visibility._W_TO_WORD)
    assert (shading._TEXTURED, shading._SMOOTH, shading._MEAN_TEXEL) == (
        scene.TEXTURED,
        scene.SMOOTH,
        scene.MEAN_TEXEL,
    )


def test_renderers_that_draw_differently_have_different_names() -> None:
    assert len({Rasteriser(s).name for s in (1, 2, 3)}) == 3
