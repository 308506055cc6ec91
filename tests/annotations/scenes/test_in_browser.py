"""Exported scenes in a real viewer: three.js in headless Chromium, by the camera in the file.

`make browser` sets it up. With ``--log-cli-level=INFO`` the measured agreements are told.
"""

from __future__ import annotations

import json
import logging
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from cadpose.annotations.document import AnnotationDocument, document_from
from cadpose.annotations.overlay import overlay_cameras, overlay_size
from cadpose.annotations.scenes.contents import Meshes
from cadpose.annotations.scenes.gltf import write_gltf_scene
from cadpose.annotations.scenes.layout import Placement
from cadpose.library.catalogue import Library
from cadpose.library.importers import add_path
from cadpose.library.sweethome3d import DEBIAN_FOLDER
from cadpose.records import Mask, Photo, Pose4Dof, Rotation, Views
from cadpose.rendering.raster import Rasteriser
from tests.annotations.factory import make_photo
from tests.annotations.scenes.made import BLOCK, OTHER, POSES, SHELF, annotated
from tests.annotations.scenes.viewer import PACKAGES, Viewer, missing, viewer

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing()), reason=missing()),
]

log = logging.getLogger(__name__)

YAMAHA = "Scopia/scopia/yamaha-yzr-r6/yamaha-yzr-r6.obj"
SCOOTER = "KatorLegaz/katorlegaz/scooter/scooter.obj"
BICYCLE = "BlendSwap-CC-BY/blendswap-cc-by/bike/bike.obj"
BOOKCASE = "BlendSwap-CC-0/blendswap-cc-0/bookcase/bookcase.obj"
BOOKS = "KatorLegaz/katorlegaz/full-bookcase/full-bookcase.obj"
BEER = "BlendSwap-CC-BY/blendswap-cc-by/beer_bottle/beer_bottle.obj"
WINE = "KatorLegaz/katorlegaz/red-wine-bottle-01/red-wine-bottle-01.obj"
CATEGORIES = ("motorbike", "bicycle", "bookcase", "bottle")

Shots = list[tuple[str, Pose4Dof]]


def pose(azimuth: float, elevation: float, inplane: float, focal: float, x: float, y: float) -> Pose4Dof:
    return Pose4Dof(Rotation(azimuth, elevation, inplane), focal, (x, y))


#: Name to the photo's size and the models with their poses.
SCENES: dict[str, tuple[tuple[int, int], Shots]] = {
    "straight ahead": ((640, 480), [(YAMAHA, pose(90, 5, 0, 700, 320, 240))]),
    "in the corner": ((640, 480), [(YAMAHA, pose(50, 15, 0, 300, 540, 400))]),
    "over the edge": ((640, 480), [(SCOOTER, pose(310, 10, 3, 600, 600, 250))]),
    "wide angle": ((640, 480), [(YAMAHA, pose(75, 8, -4, 240, 130, 110))]),
    "long and turned": ((640, 480), [(BOOKCASE, pose(20, 10, 75, 500, 300, 200))]),
    "upside down": ((640, 480), [(YAMAHA, pose(120, 30, 175, 550, 250, 260))]),
    "from above": ((640, 480), [(BOOKS, pose(0, 88, 40, 450, 350, 260))]),
    "from below": ((640, 480), [(SCOOTER, pose(200, -60, -20, 480, 200, 300))]),
    "portrait": ((360, 640), [(WINE, pose(0, 12, 2, 900, 170, 330))]),
    "panorama": ((1200, 240), [(BEER, pose(30, 20, -50, 330, 1080, 120))]),
    "behind glass": ((640, 480), [(BOOKCASE, pose(35, 25, -12, 380, 420, 300))]),
    "thin spokes": ((640, 480), [(BICYCLE, pose(75, 8, -4, 260, 130, 110))]),
    "small": ((640, 480), [(BICYCLE, pose(290, 20, 0, 60, 80, 400))]),
    "three": (
        (640, 480),
        [
            (YAMAHA, pose(60, 12, 0, 500, 200, 230)),
            (BEER, pose(10, 15, 30, 150, 480, 120)),
            (BOOKS, pose(340, 5, -3, 260, 560, 330)),
        ],
    ),
    "near and far": (
        (640, 480),
        [(SCOOTER, pose(270, 10, 0, 900, 250, 300)), (SCOOTER, pose(30, 10, 12, 70, 560, 90))],
    ),
}
#: Scenes of parts thinner than a pixel: samples at other places in it make other pixels of them.
FINE = {"thin spokes", "small"}


@pytest.fixture(scope="module")
def furniture(tmp_path_factory: pytest.TempPathFactory) -> Library:
    """The models of the scenes, with their textures."""
    if not any(DEBIAN_FOLDER.glob("*.sh3f")):
        pytest.skip(f"needs Debian's sweethome3d-furniture: no .sh3f file in {DEBIAN_FOLDER}")
    library = Library.create(tmp_path_factory.mktemp("furniture"))
    assert add_path(library, DEBIAN_FOLDER, categories=CATEGORIES, workers=1).added
    return Library.open(library.path)


@pytest.fixture(scope="module")
def shown() -> Iterator[Viewer]:
    with viewer() as page:
        yield page


@dataclass(frozen=True, eq=False)
class Scene:
    """A document with the views that its overlay picture is drawn from."""

    photo: Photo
    document: AnnotationDocument
    views: list[Views]

    @property
    def size(self) -> tuple[int, int]:
        return overlay_size(self.photo.width, self.photo.height)


def scene_of(library: Meshes, photo: Photo, shots: Shots) -> Scene:
    annotations = annotated(photo, [library.get(cad) for cad, _ in shots], [p for _, p in shots])
    raster = Rasteriser()
    views = [raster.render(library.mesh(a.cad), overlay_cameras(a)) for a in annotations]
    return Scene(photo, document_from(photo, annotations), views)


def covered(picture: NDArray[np.uint8]) -> Mask:
    return np.asarray(picture[..., 3] >= 128)


def iou(a: Mask, b: Mask) -> float:
    assert (a | b).any()
    return float((a & b).sum() / (a | b).sum())


def stray(shown: Mask, expected: Mask) -> float:
    """Pixels that differ and are not beside the silhouette's edge, as a share of its area.

    There are some where parts thinner than a pixel fall between the samples of one of the two.
    """
    wide, narrow = (f(expected.astype(np.uint8), np.ones((3, 3), np.uint8)) for f in (cv2.dilate, cv2.erode))
    return float(((shown & (wide == 0)) | (~shown & (narrow > 0))).sum() / expected.sum())


def open_scene(
    shown: Viewer, library: Meshes, scene: Scene, path: Path, placement: Placement = "overlay"
) -> None:
    write_gltf_scene(scene.document, library, scene.photo, path, placement=placement)
    told = shown.load(path)
    assert told["cameras"] == 1
    assert told["extras"]["cadpose"]["schema"] == "cadpose.annotation/1"


@pytest.mark.parametrize("name", SCENES)
def test_the_browser_shows_the_same_overlay(
    name: str, furniture: Library, shown: Viewer, tmp_path: Path
) -> None:
    size, shots = SCENES[name]
    scene = scene_of(furniture, make_photo("street.jpg", *size), shots)
    open_scene(shown, furniture, scene, tmp_path / "scene.glb")
    together = np.any([views.mask[0] for views in scene.views], axis=0)
    seen = covered(shown.show(*scene.size, "mask"))
    agreed = iou(seen, together)
    assert stray(seen, together) < (0.02 if name in FINE else 0.001)
    for number, views in enumerate(scene.views):
        assert stray(covered(shown.show(*scene.size, "mask", only=number)), views.mask[0]) < 0.02
    open_scene(shown, furniture, scene, tmp_path / "rigid.glb", "rigid")
    rigid = iou(covered(shown.show(*scene.size, "mask")), together)
    log.info("%s: IoU %.4f; rigid %.4f; %d pixels", name, agreed, rigid, together.sum())
    assert agreed >= (0.85 if name in FINE else 0.98)
    assert rigid > 0.5


@pytest.mark.parametrize("number", range(len(POSES)))
def test_textures_lie_as_ours_do(number: int, shown: Viewer, tmp_path: Path) -> None:
    cads = [BLOCK.id, OTHER.id, BLOCK.id]
    photo = make_photo()
    scene = scene_of(SHELF, photo, [(cads[number], POSES[number])])
    open_scene(shown, SHELF, scene, tmp_path / "scene.glb")
    picture = shown.show(*scene.size, "models")
    views = scene.views[0]
    assert iou(covered(shown.show(*scene.size, "mask")), views.mask[0]) >= 0.98
    # Light differs, hue does not; the seams and what is seen through glass are left out.
    sure = cv2.erode(views.mask[0].astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    sure &= picture[..., 3] == 255
    ours = views.rgb[0][sure].astype(np.float64)
    theirs = picture[..., :3][sure].astype(np.float64)
    shares = [rgb / np.maximum(rgb.sum(axis=1, keepdims=True), 1.0) for rgb in (ours, theirs)]
    alike = np.abs(shares[0] - shares[1]).max(axis=1) < 0.12
    log.info("block %d: hue alike in %.3f of %d pixels", number, alike.mean(), sure.sum())
    assert sure.sum() > 500
    assert alike.mean() > 0.95


def test_the_backdrop_is_the_photo(shown: Viewer, tmp_path: Path) -> None:
    photo = make_photo("street.jpg", 960, 640)
    scene = Scene(photo, document_from(photo, []), [])
    open_scene(shown, SHELF, scene, tmp_path / "scene.glb")
    picture = shown.show(960, 640, "whole")[..., :3].astype(int)
    difference = np.abs(picture - photo.rgb.astype(int))
    # The pattern has steps, which JPEG and filtering blur.
    assert np.median(difference) <= 2
    assert difference.mean() < 6


def test_khronos_validator_finds_no_error(furniture: Library, tmp_path: Path) -> None:
    validator = PACKAGES / "gltf-validator" / "index.js"
    node = shutil.which("node")
    if node is None or not validator.is_file():
        pytest.skip("needs node and gltf-validator: run `make browser`")
    script = (
        "const [validator, ...files] = process.argv.slice(1); const fs = require('fs');"
        "(async () => { const told = []; for (const file of files) { const report = await "
        "require(validator).validateBytes(new Uint8Array(fs.readFileSync(file))); told.push(report.issues); }"
        "console.log(JSON.stringify(told)); })();"
    )
    files = []
    for i, name in enumerate(SCENES):
        size, shots = SCENES[name]
        scene = scene_of(furniture, make_photo("street.jpg", *size), shots)
        files.append(tmp_path / f"{i}.glb")
        write_gltf_scene(scene.document, furniture, scene.photo, files[-1])
    photo = make_photo()
    files.append(tmp_path / "blocks.glb")
    write_gltf_scene(document_from(photo, annotated(photo)), SHELF, photo, files[-1])
    command = [node, "-e", script, str(validator), *map(str, files)]
    run = subprocess.run(command, capture_output=True, text=True, check=True)
    for file, issues in zip(files, json.loads(run.stdout), strict=True):
        serious = [m for m in issues["messages"] if m["severity"] <= 1]
        assert issues["numErrors"] == 0, (file.name, serious)
        assert issues["numWarnings"] == 0, (file.name, serious)
