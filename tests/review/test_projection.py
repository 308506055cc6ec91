"""The page draws a model where Python does: silhouettes of 50 random annotations, pixel by pixel.

With ``--log-cli-level=INFO`` each agreement is told.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator

import numpy as np
import pytest

from cadpose.annotations.scenes.gltf_meshes import single_mesh_glb
from cadpose.library.catalogue import Library
from cadpose.library.sweethome3d import DEBIAN_FOLDER, sweethome3d_items
from cadpose.poses import Pose4Dof, Rotation
from cadpose.records import Mask
from cadpose.rendering.raster import Rasteriser
from tests.review.view_page import ViewPage, missing, view_page
from tests.review.web_numbers import square

pytestmark = [pytest.mark.slow, pytest.mark.skipif(bool(missing()), reason=missing())]

log = logging.getLogger(__name__)

ANNOTATIONS, MODELS = 50, 25
LEAST_IOU = 0.995
#: Of an object in pixels: where one pixel is more than LEAST_IOU allows, nothing can be told.
LEAST_PIXELS = 400


@pytest.fixture(scope="module")
def furniture(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """Random models of Debian's, and the bicycle for its spokes."""
    if not any(DEBIAN_FOLDER.glob("*.sh3f")):
        pytest.skip(f"needs Debian's sweethome3d-furniture: no .sh3f file in {DEBIAN_FOLDER}")
    items = sorted(sweethome3d_items(DEBIAN_FOLDER), key=lambda item: item.id)
    chosen = np.random.default_rng(7).choice(len(items), MODELS - 1, replace=False)
    library = Library.create(tmp_path_factory.mktemp("furniture"))
    bicycle = [item for item in items if item.id.endswith("/bike/bike.obj")]
    assert not library.add([*(items[i] for i in chosen), *bicycle], workers=1).failed
    return Library.open(library.path)


@pytest.fixture(scope="module")
def shown() -> Iterator[ViewPage]:
    with view_page() as page:
        yield page
        assert page.said == []


def random_pose(rng: np.random.Generator, width: int, height: int) -> Pose4Dof:
    """Any rotation; a diagonal of 60 pixels to more than the photo; perhaps partly outside of it."""
    low, high = (-90.0, 90.0) if rng.random() < 0.5 else (-15.0, 45.0)
    rotation = Rotation(rng.uniform(0, 360), rng.uniform(low, high), rng.uniform(-180, 180))
    size = float(np.exp(rng.uniform(np.log(60.0), np.log(1.3 * max(width, height)))))
    x, y = rng.uniform(-0.1, 1.1, 2) * (width, height)
    t_z = 2.0 if rng.random() < 0.7 else float(rng.uniform(1.0, 6.0))
    return Pose4Dof(rotation, size * t_z, (float(x), float(y)), t_z)


def iou(a: Mask, b: Mask) -> float:
    return float((a & b).sum() / max(1, (a | b).sum()))


def test_silhouettes_are_pythons(shown: ViewPage, furniture: Library) -> None:
    rng, raster = np.random.default_rng(3), Rasteriser()
    models = furniture.models()
    told: list[tuple[float, str]] = []
    outside = 0
    for number in range(ANNOTATIONS):
        mesh = furniture.mesh(models[number % len(models)])
        while True:
            width, height = (int(n) for n in rng.integers(201, 1400, 2))
            pose = random_pose(rng, width, height)
            mask = raster.render(mesh, pose.to_cameras(width, height)).mask[0]
            if mask.sum() >= LEAST_PIXELS:
                break
        border = mask[0].any() or mask[-1].any() or mask[:, 0].any() or mask[:, -1].any()
        outside += bool(border)
        shown.show(single_mesh_glb(mesh), pose, width, height)
        found = iou(shown.silhouette(), mask)
        name = models[number % len(models)].id
        text = f"{found:.5f} {name}, {mask.sum()} pixels of {width} x {height}, {pose}"
        log.info(text)
        told.append((found, text))
    values = np.array([value for value, _ in told])
    log.info("%d annotations: IoU min %.5f, median %.6f", len(told), values.min(), np.median(values))
    assert outside >= 10, "some objects are to be partly outside of the photo"
    assert values.min() >= LEAST_IOU, min(told)
    assert np.median(values) >= 0.999


@pytest.mark.parametrize("texels", [16, 67, 512])
def test_holes_of_textures_are_pythons(shown: ViewPage, texels: int) -> None:
    """Also where many texels fall on a sample and a coarser level is read."""
    y, x = np.mgrid[:texels, :texels] * (8.0 / texels)
    holes = (np.hypot(x % 1 - 0.5, y % 1 - 0.5) > 0.3) * 255
    texture = np.dstack([np.full((texels, texels, 3), 200), holes]).astype(np.uint8)
    mesh = square(texture, 1.0)
    glb, raster = single_mesh_glb(mesh), Rasteriser()
    for size, azimuth, elevation in ((90.0, 0.0, 0.0), (300.0, 30.0, 20.0), (500.0, 200.0, -35.0)):
        pose = Pose4Dof(Rotation(azimuth, elevation, 13.0), 2 * size, (301.3, 240.7))
        mask = raster.render(mesh, pose.to_cameras(611, 473)).mask[0]
        shown.show(glb, pose, 611, 473)
        page = shown.silhouette()
        solid = raster.render(square(None, 1.0), pose.to_cameras(611, 473)).mask[0]
        assert mask.sum() < 0.85 * solid.sum(), "there are to be holes"
        log.info("holes of %d texels at %g pixels: %.5f", texels, size, iou(page, mask))
        assert iou(page, mask) > 0.99, (texels, size, iou(page, mask))


def test_glass_covers_and_the_invisible_does_not(shown: ViewPage) -> None:
    pose = Pose4Dof(Rotation(20.0, 10.0), 400.0, (150.0, 100.0))
    whole = Rasteriser().render(square(None, 0.3), pose.to_cameras(300, 200)).mask[0]
    shown.show(single_mesh_glb(square(None, 0.3)), pose, 300, 200)
    assert iou(shown.silhouette(), whole) >= 0.999
    shown.show(single_mesh_glb(square(None, 0.0)), pose, 300, 200)
    assert not shown.silhouette().any()


def test_what_reaches_behind_the_camera_is_cut_off(shown: ViewPage) -> None:
    mesh = square(None, 1.0)
    pose = Pose4Dof(Rotation(60.0, 10.0, 5.0), 120.0, (150.0, 100.0), t_z=0.2)
    mask = Rasteriser().render(mesh, pose.to_cameras(300, 200)).mask[0]
    shown.show(single_mesh_glb(mesh), pose, 300, 200)
    assert 0 < mask.sum() < mask.size
    assert iou(shown.silhouette(), mask) >= LEAST_IOU


def test_the_fit_is_that_of_the_masks(shown: ViewPage) -> None:
    mesh = square(None, 1.0)
    pose = Pose4Dof(Rotation(25.0, 15.0, 40.0), 900.0, (300.0, 300.0))
    shown.show(single_mesh_glb(mesh), pose, 601, 450)
    assert shown.page.evaluate("view.fitMask()") is None
    mask = np.zeros((450, 601), np.bool_)
    mask[100:400, 200:380] = True
    rows = "".join(map(str, mask.astype(int).ravel()))
    shown.page.evaluate("rows => view.setMask(Uint8Array.from(rows, Number))", rows)
    drawn = Rasteriser().render(mesh, pose.to_cameras(601, 450)).mask[0]
    assert shown.page.evaluate("view.fitMask()") == pytest.approx(iou(drawn, mask), abs=1e-3)
